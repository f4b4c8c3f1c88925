#include "io/stack/manifest.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <set>
#include <span>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "io/file/digest.h"
#include "io/file/file_name.h"
#include "io/stack/canonical_json.h"
#include "vdbdither/engine/json_text.h"
#include "vdbdither/engine/version.h"
#include "vdbdither/model/errors.h"
#include "vdbdither/model/printable.h"

namespace vdbdither {

namespace {

using nlohmann::ordered_json;

template <class Triple>
ordered_json jsonOf(const Triple& triple) {
  return ordered_json::array({triple[0], triple[1], triple[2]});
}

constexpr const char* digest_key = "sha256";

/// A manifest is a description in one piece; a larger file is not one.
constexpr std::uint64_t most_bytes = std::uint64_t{64} << 20;

/// The digest of the canonical form of all but the digest itself.
std::string digestOf(const ordered_json& json) {
  Digest digest;
  writeCanonically(
      json, [&](std::string_view text) { digest.update(text.data(), text.size()); }, digest_key);
  return hexText(digest.finish());
}

/// Looks for a key that an object has twice: programs disagree about which value counts.
class RepeatedKey : public nlohmann::json_sax<ordered_json> {
 public:
  std::string found{};  ///< empty if there is none

  bool null() override { return true; }
  bool boolean(bool) override { return true; }
  bool number_integer(number_integer_t) override { return true; }
  bool number_unsigned(number_unsigned_t) override { return true; }
  bool number_float(number_float_t, const string_t&) override { return true; }
  bool string(string_t&) override { return true; }
  bool binary(binary_t&) override { return true; }
  bool start_array(std::size_t) override { return true; }
  bool end_array() override { return true; }
  bool start_object(std::size_t) override {
    open_.emplace_back();
    return true;
  }
  bool end_object() override {
    open_.pop_back();
    return true;
  }
  bool key(string_t& key) override {
    if (!open_.back().insert(key).second) found = key;
    return found.empty();
  }
  bool parse_error(std::size_t, const std::string&, const ordered_json::exception&) override {
    return false;  // the parser says what is wrong
  }

 private:
  std::vector<std::set<std::string>> open_;  ///< the keys of each object that is not at its end
};

/// Parses a manifest, which may come from anywhere: what takes memory or time out of proportion is
/// refused.
class ManifestParser {
 public:
  explicit ManifestParser(const StackInput& stack) : shown_("'" + stack.shownManifest() + "'") {
    const std::vector<std::uint8_t> bytes = stack.read(stack.manifestName(), most_bytes);
    checkShape(bytes);
    const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
    RepeatedKey repeated;
    ordered_json::sax_parse(text, &repeated);
    if (!repeated.found.empty())
      refuse("it has the key '" + printable(shortened(repeated.found, 60)) + "' twice");
    json_ = parsedJson(text);
    if (json_.is_discarded()) refuse(jsonProblem(text));
    if (!json_.is_object()) refuse("it is not a JSON object");
  }

  [[nodiscard]] const ordered_json& json() const { return json_; }

  [[noreturn]] void refuse(const std::string& why) const {
    throw DataError(shown_ + " is not a manifest of slice-export: " + why + make_stack_again);
  }

  [[nodiscard]] const ordered_json& member(const ordered_json& json, const std::string& key) const {
    const auto found = json.is_object() ? json.find(key) : json.end();
    if (!json.is_object() || found == json.end()) refuse("'" + key + "' is missing");
    return *found;
  }

  [[nodiscard]] std::string text(const ordered_json& json, const std::string& key) const {
    const ordered_json& value = member(json, key);
    if (!value.is_string()) refuse("'" + key + "' is not a text");
    return value.get<std::string>();
  }

  [[nodiscard]] bool flag(const ordered_json& json, const std::string& key) const {
    const ordered_json& value = member(json, key);
    if (!value.is_boolean()) refuse("'" + key + "' is neither true nor false");
    return value.get<bool>();
  }

  [[nodiscard]] const ordered_json& list(const ordered_json& json, const std::string& key) const {
    const ordered_json& value = member(json, key);
    if (!value.is_array()) refuse("'" + key + "' is not a list");
    return value;
  }

  [[nodiscard]] int integer(const ordered_json& json, const std::string& key, int min,
                            int max) const {
    return integerOf(member(json, key), key, min, max);
  }

  [[nodiscard]] int integerOf(const ordered_json& value, const std::string& key, int min,
                              int max) const {
    // Only a double holds every number of JSON.
    if (!value.is_number_integer() || !(value.get<double>() >= min && value.get<double>() <= max)) {
      refuse("'" + key + "' must be a whole number from " + std::to_string(min) + " to " +
             std::to_string(max));
    }
    return value.get<int>();
  }

  [[nodiscard]] openvdb::Vec3d lengths(const std::string& key) const {
    const ordered_json& values = list(json_, key);
    constexpr double longest_mm = 1e6;
    openvdb::Vec3d result;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      if (values.size() != 3 || !values[axis].is_number() ||
          !(std::abs(values[axis].get<double>()) <= longest_mm)) {
        refuse("'" + key + "' must be three lengths of at most 1000000 mm");
      }
      result[static_cast<int>(axis)] = values[axis].get<double>();
    }
    return result;
  }

  [[nodiscard]] openvdb::Coord corner(const std::string& key) const {
    const ordered_json& values = list(member(json_, "box"), key);
    if (values.size() != 3) refuse("'" + key + "' must be three whole numbers");
    openvdb::Coord result;
    for (int axis = 0; axis < 3; ++axis)
      result[axis] = integerOf(values[static_cast<std::size_t>(axis)], key, -farthest, farthest);
    return result;
  }

  [[nodiscard]] int frame(const std::string& key, int axis) const {
    const ordered_json& values = list(member(json_, "frame"), key);
    if (values.size() != 2) refuse("'" + key + "' of 'frame' must be two whole numbers");
    return integerOf(values[static_cast<std::size_t>(axis)], key, -farthest, farthest);
  }

  [[nodiscard]] std::array<std::uint8_t, 4> colour(const ordered_json& json,
                                                   const std::string& key) const {
    const ordered_json& values = list(json, key);
    if (values.size() != 4) refuse("'" + key + "' must be four whole numbers");
    std::array<std::uint8_t, 4> result{};
    for (std::size_t i = 0; i < 4; ++i)
      result[i] = static_cast<std::uint8_t>(integerOf(values[i], key, 0, 255));
    return result;
  }

  /// The path of a slice, which must lie in the stack.
  [[nodiscard]] std::string file(const ordered_json& slice) const {
    std::string name = text(slice, "file");
    if (const auto problem = relativePathProblem(name)) {
      throw DataError(shown_ + ": the name of the slice '" + name + "' " + *problem +
                      make_stack_again);
    }
    return name;
  }

  static constexpr int farthest = 1 << 29;

 private:
  /// Looks at no more than brackets, commas and colons outside of strings, before memory is taken.
  void checkShape(std::span<const std::uint8_t> bytes) const {
    constexpr std::size_t most_values = 1 << 22;
    constexpr std::size_t deepest = 16;
    constexpr int most_keys = 100;
    std::size_t values = 0;
    std::array<int, deepest + 1> keys{};
    std::size_t depth = 0;
    bool in_string = false;
    for (std::size_t i = 0; i < bytes.size(); ++i) {
      const std::uint8_t byte = bytes[i];
      if (byte == '"') in_string = !in_string;
      if (in_string) {
        if (byte == '\\') ++i;
        continue;
      }
      if (byte == '{' || byte == '[') {
        if (++depth > deepest) refuse("it is nested too deeply");
        keys[depth] = 0;
      }
      if ((byte == '}' || byte == ']') && depth > 0) --depth;
      if (byte == ':' && ++keys[depth] > most_keys) refuse("an object has too many keys");
      if ((byte == ',' || byte == '[') && ++values > most_values)
        refuse("it holds too many values");
    }
  }

  std::string shown_;
  ordered_json json_;
};

Manifest manifestOf(const ManifestParser& parser) {
  const ordered_json& json = parser.json();
  constexpr int farthest = ManifestParser::farthest;
  Manifest manifest;
  manifest.lattice.pitch_mm = parser.lengths("pitch_mm");
  manifest.lattice.origin_mm = parser.lengths("origin_mm");
  manifest.lattice.box = {parser.corner("min"), parser.corner("max")};
  manifest.format = parser.text(json, "format");
  if (json.contains("grid")) manifest.grid = parser.text(json, "grid");
  constexpr int most_padding = 1 << 24;
  manifest.layout = {manifest.lattice.box, parser.integer(json, "padding", 0, most_padding),
                     parser.flag(json, "flip_x"), parser.flag(json, "flip_y")};
  if (json.contains("frame")) {
    for (int axis = 0; axis < 2; ++axis) {
      manifest.layout.box.min()[axis] = parser.frame("min", axis);
      manifest.layout.box.max()[axis] = parser.frame("max", axis);
    }
    if (manifest.layout.box.empty()) parser.refuse("'frame' has no voxels");
  }
  const ordered_json& size = parser.list(json, "size");
  if (size.size() != 3 || size[0] != manifest.layout.width() || size[1] != manifest.layout.height())
    parser.refuse(
        "'size' must be the width and height that follow from 'box' or 'frame' and 'padding', and "
        "the number of layers");
  manifest.layers.begin = parser.integer(json, "first_layer", -farthest, farthest);
  manifest.layers.end = manifest.layers.begin + parser.integerOf(size[2], "size", 0, 2 * farthest);
  if (json.contains("cropped")) {
    manifest.cropped_below = parser.integer(json["cropped"], "below", 0, farthest);
    manifest.cropped_above = parser.integer(json["cropped"], "above", 0, farthest);
  }
  manifest.background = parser.colour(json, "background");
  for (const ordered_json& entry : parser.list(json, "materials"))
    manifest.materials.push_back({parser.text(entry, "name"), parser.colour(entry, "rgba")});
  const ordered_json& printer = parser.member(json, "printer");
  if (!printer.is_null()) manifest.printer = jsonText(printer);
  for (const ordered_json& line : parser.list(json, "history")) {
    if (!line.is_string()) parser.refuse("'history' is not a list of texts");
    manifest.history.push_back(line.get<std::string>());
  }
  for (const ordered_json& entry : parser.list(json, "slices")) {
    manifest.slices.push_back({parser.integer(entry, "layer", -farthest, farthest),
                               parser.file(entry), parser.text(entry, "sha256"),
                               entry.contains("material") ? parser.text(entry, "material") : ""});
  }
  // What checks a stack looks at every layer, and tells of those that are missing.
  constexpr std::int64_t most_unnamed = 1 << 16;
  if (manifest.layers.size() > most_unnamed + static_cast<std::int64_t>(manifest.slices.size())) {
    parser.refuse("it has " + std::to_string(manifest.layers.size()) + " layers and names " +
                  std::to_string(manifest.slices.size()) + " slices");
  }
  return manifest;
}

/// Compares the manifest with its digest.
void checkDigest(const ManifestParser& parser, const std::string& shown, EditedStack edited,
                 const std::function<void(const std::string&)>& warn) {
  const ordered_json& json = parser.json();
  std::string problem;
  if (!json.contains(digest_key)) {
    problem = " has no digest of itself, so it was edited or made by an earlier version";
  } else if (parser.text(json, digest_key) != digestOf(json)) {
    problem = " was changed after slice-export wrote it: its digest differs";
  } else {
    return;
  }
  if (edited == EditedStack::refused)
    throw DataError(shown + problem + make_stack_again_or_take_edited);
  warn(shown + problem + "; it is taken as it is");
}

}  // namespace

std::string textOf(const Manifest& manifest) {
  const SliceLayout& layout = manifest.layout;
  const Lattice& lattice = manifest.lattice;
  ordered_json json;
  json["creator"] = std::string("vdbdither ") + version;
  const ordered_json printer = parsedJson(manifest.printer);
  json["printer"] = printer.is_discarded() ? ordered_json() : printer;
  json["format"] = manifest.format;
  json["grid"] = manifest.grid;
  json["pitch_mm"] = jsonOf(lattice.pitch_mm);
  json["origin_mm"] = jsonOf(lattice.origin_mm);
  json["size"] = {layout.width(), layout.height(), manifest.layers.size()};
  json["first_layer"] = manifest.layers.begin;
  json["cropped"] = {{"below", manifest.cropped_below}, {"above", manifest.cropped_above}};
  json["box"] = {{"min", jsonOf(lattice.box.min())}, {"max", jsonOf(lattice.box.max())}};
  const openvdb::CoordBBox& frame = layout.box;
  if (frame != lattice.box) {
    json["frame"] = {{"min", {frame.min().x(), frame.min().y()}},
                     {"max", {frame.max().x(), frame.max().y()}}};
  }
  json["padding"] = layout.padding;
  json["flip_x"] = layout.flip_x;
  json["flip_y"] = layout.flip_y;
  json["background"] = manifest.background;
  json["materials"] = ordered_json::array();
  for (std::size_t i = 0; i < manifest.materials.size(); ++i) {
    const std::uint64_t voxels = manifest.voxels[i];
    json["materials"].push_back(
        {{"index", i + 1},
         {"name", manifest.materials[i].name},
         {"rgba", manifest.materials[i].rgba},
         {"voxels", voxels},
         {"ml", static_cast<double>(voxels) * lattice.pitch_mm.product() / 1000}});
  }
  json["history"] = manifest.history;
  json["slices"] = ordered_json::array();
  for (const Manifest::Slice& slice : manifest.slices) {
    ordered_json entry = {{"layer", slice.layer}, {"file", slice.file}, {"sha256", slice.sha256}};
    if (!slice.material.empty()) entry["material"] = slice.material;
    json["slices"].push_back(std::move(entry));
  }
  // The digest is of what a reader will parse.
  json = parsedJson(jsonText(json));
  json[digest_key] = digestOf(json);
  return jsonText(json, 1) + "\n";
}

Manifest readManifest(const StackInput& stack, EditedStack edited,
                      const std::function<void(const std::string&)>& warn) {
  const ManifestParser parser(stack);
  const std::string shown = "'" + stack.shownManifest() + "'";
  static_cast<void>(parser.list(parser.json(), "slices"));
  checkDigest(parser, shown, edited, warn);
  Manifest manifest = manifestOf(parser);
  const Lattice& lattice = manifest.lattice;
  for (int axis = 0; axis < 3; ++axis) {
    constexpr double finest_mm = 1e-6;
    if (!(lattice.pitch_mm[axis] >= finest_mm))
      throw DataError(shown + ": pitch_mm is below 0.000001" + make_stack_again);
  }
  const openvdb::Coord size = manifest.layout.box.dim();
  constexpr std::int64_t widest = 1 << 24;
  if (lattice.box.empty() || manifest.layers.empty() ||
      size.x() + std::int64_t{2} * manifest.layout.padding > widest ||
      size.y() + std::int64_t{2} * manifest.layout.padding > widest || size.z() > widest ||
      intersection(manifest.knownLayers(), lattice.layers()) != manifest.knownLayers()) {
    throw DataError(shown + ": box, padding and layers do not fit together" + make_stack_again);
  }
  return manifest;
}

std::set<std::string> filesNamedBy(const StackInput& stack) {
  const ManifestParser parser(stack);
  std::set<std::string> names;
  for (const ordered_json& slice : parser.list(parser.json(), "slices"))
    names.insert(parser.file(slice));
  return names;
}

}  // namespace vdbdither
