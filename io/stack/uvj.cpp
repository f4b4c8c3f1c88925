// UVJ, an archive of slices for resin printers with its settings in JSON. After the description of
// the format by uv3dp and the reader of UVtools.

#include <algorithm>
#include <array>
#include <cmath>

#include <nlohmann/json.hpp>

#include "io/image/png_decoder.h"
#include "io/stack/resin_slices.h"
#include "vdbdither/engine/json_text.h"
#include "vdbdither/engine/option_values.h"
#include "vdbdither/model/errors.h"
#include "vdbdither/model/words.h"

namespace vdbdither {

namespace {

using nlohmann::ordered_json;

constexpr const char* configuration_name = "config.json";
constexpr int number_digits = 8;
/// X and Y are stored in 16 bits.
constexpr int widest = 65535;
constexpr const char* folder = "slice/";
constexpr std::array<const char*, 2> preview_names{"preview/tiny.png", "preview/huge.png"};
const SliceNames uvj_names{"", number_digits, 0};

ordered_json exposure(double seconds) {
  // The movements are usual ones; programs that convert the archive ask for them.
  return {{"LightOffTime", 0}, {"LightOnTime", seconds}, {"LightPWM", 255},    {"LiftHeight", 5},
          {"LiftSpeed", 60},   {"RetractHeight", 5},     {"RetractSpeed", 150}};
}

class UvjSlices : public ResinSlices {
 public:
  UvjSlices() : ResinSlices("uvj", folder) {}

  void plan(const Manifest& stack, const Grids& grids) override {
    ResinSlices::plan(stack, grids);
    if (stack.layout.width() > widest || stack.layout.height() > widest) {
      throw UsageError("--format: the slices of uvj have at most 65535 x 65535 pixels, not " +
                       std::to_string(stack.layout.width()) + " x " +
                       std::to_string(stack.layout.height()) + "; take sl1");
    }
  }

  void finish(const Manifest& stack, const SpanImage& preview, StackOutput& output) const override {
    const SliceLayout& layout = stack.layout;
    ordered_json bottom = exposure(bottomExposureSeconds());
    const int bottom_layers = std::min(bottomLayers(), stack.layers.size());
    ordered_json json;
    json["Properties"] = {
        {"Size",
         {{"X", layout.width()},
          {"Y", layout.height()},
          {"Millimeter",
           {{"X", layout.width() * pitchMm().x()}, {"Y", layout.height() * pitchMm().y()}}},
          {"Layers", stack.layers.size()},
          {"LayerHeight", pitchMm().z()}}},
        {"Exposure", exposure(exposureSeconds())},
        {"Bottom", bottom},
        {"AntiAliasLevel", 1},
        // Ours: without it a reader cannot tell left from right.
        {"Mirror", {{"X", stack.layout.flip_x}, {"Y", stack.layout.flip_y}}}};
    json["Properties"]["Bottom"]["Count"] = bottom_layers;
    json["Layers"] = ordered_json::array();
    for (int i = 0; i < stack.layers.size(); ++i) {
      json["Layers"].push_back(
          {{"Z", (i + 1) * pitchMm().z()},
           {"Exposure", i < bottom_layers ? bottom : exposure(exposureSeconds())}});
    }
    writeText(output, configuration_name, jsonText(json, 1) + "\n");
    output.write(preview_names[0], encodePicture(thumbnailOf(preview, 400, 400)));
    output.write(preview_names[1], encodePicture(thumbnailOf(preview, 800, 480)));
  }
};

/// Returns a number of `json` by its path. Throws DataError.
double numberAt(const ordered_json& json, const char* path, const std::string& shown) {
  const ordered_json::json_pointer pointer(path);
  if (!json.contains(pointer) || !json[pointer].is_number())
    throw DataError(shown + ": '" + path + "' must be a number");
  return json[pointer].get<double>();
}

ordered_json configurationOf(const StackInput& files) {
  const std::vector<std::uint8_t> bytes = files.read(configuration_name, most_configuration_bytes);
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  ordered_json json = parsedJson(text);
  // Others call their settings so too, in other languages, but not their slices.
  const std::string first_slice = folder + zeroPadded(0, number_digits) + ".png";
  if (json.is_discarded() && files.contains(first_slice))
    throw DataError("'" + files.shown(configuration_name) + "': " + jsonProblem(text));
  return json;
}

/// Tells where the list of layers contradicts the size.
void checkUvj(const StackInput& files, const DescribedStack& stack,
              std::span<const std::uint64_t> /*voxels*/, Findings& findings) {
  const std::string file = files.shown(configuration_name);
  const ordered_json json = configurationOf(files);
  const ordered_json& layers = json["Layers"];
  const auto count = static_cast<std::size_t>(stack.manifest.layers.size());
  if (!layers.is_array() || layers.size() != count) {
    findings.error("layer-list",
                   "Layers lists " + std::to_string(layers.is_array() ? layers.size() : 0) +
                       " layers, and Size says " + std::to_string(count) + "; make the stack again",
                   file);
  }
  const double layer_mm = stack.manifest.lattice.pitch_mm.z();
  for (std::size_t i = 0; layers.is_array() && i < layers.size(); ++i) {
    const double expected_mm = static_cast<double>(i + 1) * layer_mm;
    const ordered_json* z = nullptr;
    if (layers[i].is_object() && layers[i].contains("Z")) z = &layers[i]["Z"];
    if (z != nullptr && z->is_number() &&
        std::abs(z->get<double>() - expected_mm) <= 0.01 * layer_mm + 1e-6 * expected_mm)
      continue;
    constexpr double micrometres = 1e3;
    findings.add({"layer-height", Finding::Severity::error,
                  "its Z in Layers is not " +
                      shortestText(std::round(expected_mm * micrometres) / micrometres) +
                      " mm, as layers of " + shortestText(layer_mm) +
                      " mm make it; make the stack again",
                  file, static_cast<int>(i)});
  }
  tellMissingPictures(files, preview_names, findings);
}

std::optional<DescribedStack> describeUvj(const StackInput& files) {
  if (!files.contains(configuration_name)) return std::nullopt;
  const std::string shown = "'" + files.shown(configuration_name) + "'";
  const ordered_json json = configurationOf(files);
  if (!json.is_object() || !json.contains("Properties") || !json.contains("Layers"))
    return std::nullopt;
  const auto whole = [&](const char* path) {
    const double number = numberAt(json, path, shown);
    if (!(number >= 1 && number <= 1 << 24))
      throw DataError(shown + ": '" + path + "' must be from 1 to 16777216");
    return static_cast<std::int64_t>(number);
  };
  ContainerContents contents;
  contents.format = "uvj";
  contents.configuration = configuration_name;
  contents.shown = shown;
  contents.width = whole("/Properties/Size/X");
  contents.height = whole("/Properties/Size/Y");
  contents.layers = whole("/Properties/Size/Layers");
  contents.pitch_mm = {
      numberAt(json, "/Properties/Size/Millimeter/X", shown) / static_cast<double>(contents.width),
      numberAt(json, "/Properties/Size/Millimeter/Y", shown) / static_cast<double>(contents.height),
      numberAt(json, "/Properties/Size/LayerHeight", shown)};
  const auto flag = [&](const char* path) {
    const ordered_json::json_pointer pointer(path);
    return json.contains(pointer) && json[pointer].is_boolean() && json[pointer].get<bool>();
  };
  contents.flip_x = flag("/Properties/Mirror/X");
  contents.flip_y = flag("/Properties/Mirror/Y");
  contents.materials = resinTable();
  contents.file_name = [](int layer, std::size_t /*material*/) {
    return folder + zeroPadded(layer, number_digits) + ".png";
  };
  return describedBy(contents, files);
}

}  // namespace

extern const SliceFormat uvj;
const SliceFormat uvj{.name = "uvj",
                      .summary = "Archive for resin printers that describes itself in JSON",
                      .ending = ".png",
                      .pixel = SlicePixel::printed,
                      .encoder = makeSliceEncoder<UvjSlices>,
                      .decode = decodePng,
                      .decodes_colours = true,
                      .bytes_per_leaf = 80,
                      .container_ending = ".uvj",
                      .describe = describeUvj,
                      .check = checkUvj,
                      .names = &uvj_names,
                      .shows_display = true};

}  // namespace vdbdither
