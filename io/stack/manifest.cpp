#include "io/stack/manifest.h"

#include <nlohmann/json.hpp>

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

template <class Triple>
Triple tripleOf(const ordered_json& json) {
  Triple triple;
  for (int axis = 0; axis < 3; ++axis) json.at(axis).get_to(triple[axis]);
  return triple;
}

Manifest manifestOf(const ordered_json& json) {
  Manifest manifest;
  manifest.lattice.pitch_mm = tripleOf<openvdb::Vec3d>(json.at("pitch_mm"));
  manifest.lattice.origin_mm = tripleOf<openvdb::Vec3d>(json.at("origin_mm"));
  manifest.lattice.box = {tripleOf<openvdb::Coord>(json.at("box").at("min")),
                          tripleOf<openvdb::Coord>(json.at("box").at("max"))};
  manifest.format = json.at("format");
  manifest.grid = json.value("grid", material_grid);
  manifest.layout = {manifest.lattice.box, json.at("padding"), json.at("flip_x"),
                     json.at("flip_y")};
  manifest.layers.begin = json.at("first_layer");
  manifest.layers.end = manifest.layers.begin + json.at("size").at(2).get<int>();
  if (json.contains("cropped")) {
    manifest.cropped_below = json["cropped"].at("below");
    manifest.cropped_above = json["cropped"].at("above");
  }
  manifest.background = json.at("background");
  for (const ordered_json& entry : json.at("materials"))
    manifest.materials.push_back(
        {printable(entry.at("name").get<std::string>()), entry.at("rgba")});
  if (!json.at("printer").is_null()) manifest.printer = jsonText(json["printer"]);
  for (const ordered_json& line : json.at("history"))
    manifest.history.push_back(line.get<std::string>());
  for (const ordered_json& entry : json.at("slices")) {
    manifest.slices.push_back(
        {entry.at("layer"), entry.at("file"), entry.at("sha256"), entry.value("material", "")});
  }
  return manifest;
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
  return jsonText(json, 1) + "\n";
}

Manifest readManifest(const StackInput& stack) {
  const std::vector<std::uint8_t> bytes = stack.read(manifest_name);
  const std::string shown = "'" + stack.shown(manifest_name) + "'";
  Manifest manifest;
  const ordered_json json = parsedJson({reinterpret_cast<const char*>(bytes.data()), bytes.size()});
  const std::string refused = shown + " is not a manifest of slice-export: ";
  if (json.is_discarded()) throw DataError(refused + "it is no JSON" + make_stack_again);
  try {
    manifest = manifestOf(json);
  } catch (const ordered_json::exception&) {
    throw DataError(refused + "a key is missing, or its value is of another type" +
                    make_stack_again);
  }
  const Lattice& lattice = manifest.lattice;
  for (int axis = 0; axis < 3; ++axis) {
    if (!(lattice.pitch_mm[axis] > 0))
      throw DataError(shown + ": pitch_mm is not above zero" + make_stack_again);
  }
  if (lattice.box.empty() || manifest.layout.padding < 0 || manifest.layers.empty() ||
      manifest.cropped_below < 0 || manifest.cropped_above < 0 ||
      intersection(manifest.knownLayers(), lattice.layers()) != manifest.knownLayers()) {
    throw DataError(shown + ": box, padding and layers do not fit together" + make_stack_again);
  }
  return manifest;
}

}  // namespace vdbdither
