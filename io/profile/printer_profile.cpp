#include "io/profile/printer_profile.h"

#include <algorithm>
#include <filesystem>

#include <nlohmann/json.hpp>

#include "io/file/data_files.h"
#include "io/file/whole_file.h"
#include "io/profile/profile_parser.h"
#include "vdbdither/engine/json_text.h"
#include "vdbdither/model/errors.h"
#include "vdbdither/model/known_grids.h"

namespace vdbdither {

using nlohmann::ordered_json;

namespace {

ordered_json tripleOf(const openvdb::Vec3d& numbers) {
  return {numbers[0], numbers[1], numbers[2]};
}

ordered_json jsonOf(const Material& material) {
  ordered_json json{{"name", material.name}, {"rgba", material.rgba}};
  if (material.linear_rgb) json["linear_rgb"] = tripleOf(*material.linear_rgb);
  if (material.absorption) json["absorption"] = tripleOf(*material.absorption);
  if (material.scattering) json["scattering"] = tripleOf(*material.scattering);
  if (material.density_g_per_cm3) json["density_g_per_cm3"] = *material.density_g_per_cm3;
  if (!material.resin.empty()) json["resin"] = material.resin;
  return json;
}

PrinterProfile parse(const std::string& text) {
  const ProfileParser parser(parsedJson(text));
  if (!parser.problems().empty()) throw DataError(parser.problems().front().message);
  return parser.profile();
}

/// The file that `name_or_path` names and what it holds.
std::pair<std::filesystem::path, std::string> readProfile(const std::string& name_or_path) {
  std::filesystem::path path = name_or_path;
  if (!name_or_path.ends_with(".json")) {
    const std::vector<std::string> names = installedPrinters();
    if (std::find(names.begin(), names.end(), name_or_path) == names.end()) {
      std::string message = "no printer '" + name_or_path + "'; there are";
      for (const std::string& name : names) message += " " + name;
      throw UsageError(message + ", or name a profile file ending in .json");
    }
    path = *findDataFile("printers/" + name_or_path + ".json");
  }
  std::error_code none;
  const std::string shown = "'" + path.string() + "'";
  if (!std::filesystem::exists(path, none)) throw UsageError("no such printer profile " + shown);
  if (!std::filesystem::is_regular_file(path, none))
    throw UsageError("the printer profile " + shown + " is not a regular file");
  constexpr std::uint64_t most_bytes = 1 << 20;
  const std::vector<std::uint8_t> bytes = readWholeFile(path, shown, most_bytes);
  return {path, {bytes.begin(), bytes.end()}};
}

}  // namespace

PrinterProfile readPrinterProfile(const std::string& name_or_path) {
  const auto [path, text] = readProfile(name_or_path);
  try {
    return parse(text);
  } catch (const DataError& error) {
    throw DataError("'" + path.string() + "' is not a printer profile: " + error.what());
  }
}

std::vector<std::string> printerProfileProblems(const std::string& name_or_path) {
  const auto [path, text] = readProfile(name_or_path);
  const ProfileParser parser(parsedJson(text));
  std::vector<std::string> problems;
  for (const ProfileProblem& problem : parser.problems()) problems.push_back(problem.message);
  if (!parser.profile().name.empty() && parser.profile().name != path.stem())
    problems.push_back("its name '" + parser.profile().name + "' is not that of its file");
  return problems;
}

std::string toJson(const PrinterProfile& profile) {
  ordered_json json;
  json["name"] = profile.name;
  json["title"] = profile.title;
  json["source"] = profile.source;
  if (!profile.technology.empty()) json["technology"] = profile.technology;
  json["pitch_mm"] = tripleOf(profile.pitch_mm);
  if (const auto& range = profile.layer_mm) json["layer_mm"] = {(*range)[0], (*range)[1]};
  json["build_mm"] = tripleOf(profile.build_mm);
  if (!profile.slice_px.isZero()) json["slice_px"] = {profile.slice_px[0], profile.slice_px[1]};
  if (profile.origin != PrinterProfile().origin) json["origin"] = profile.origin;
  if (profile.mirror_x) json["mirror_x"] = true;
  if (profile.mirror_y) json["mirror_y"] = true;
  if (profile.minimum_slices > 0) json["minimum_slices"] = profile.minimum_slices;
  if (profile.maximum_colours > 0) json["maximum_colours"] = profile.maximum_colours;
  if (!profile.containers.empty()) json["containers"] = profile.containers;
  if (!profile.printer_notes.empty()) json["printer_notes"] = profile.printer_notes;
  if (!profile.point_spread_mm.isZero())
    json["point_spread_mm"] = tripleOf(profile.point_spread_mm);
  if (profile.yule_nielsen != PrinterProfile().yule_nielsen)
    json["yule_nielsen"] = tripleOf(profile.yule_nielsen);
  if (const auto& mirror = profile.kubelka_munk)
    json["kubelka_munk"] = {{"outer", mirror->outer}, {"inner", tripleOf(mirror->inner)}};
  json["materials"] = ordered_json::array();
  for (const Material& material : profile.materials) json["materials"].push_back(jsonOf(material));
  return jsonText(json);
}

PrinterProfile printerProfileFromJson(const std::string& text) {
  try {
    return parse(text);
  } catch (const DataError& error) {
    throw DataError(std::string("the metadata vdbdither:printer is not a printer profile: ") +
                    error.what());
  }
}

PrinterProfile printerProfileOf(const Schema& schema) {
  const auto printer = schema.metadata.find(printer_key);
  return printer == schema.metadata.end() ? PrinterProfile()
                                          : printerProfileFromJson(printer->second);
}

openvdb::Vec3d pointSpreadMmOf(const Schema& schema) {
  constexpr double usual_mm = 0.05;
  const openvdb::Vec3d stated = printerProfileOf(schema).point_spread_mm;
  return stated.isZero() ? openvdb::Vec3d(usual_mm) : stated;
}

std::vector<std::string> installedPrinters() {
  std::vector<std::string> names;
  for (const std::filesystem::path& folder : dataFolders()) {
    std::error_code none;
    for (const auto& entry : std::filesystem::directory_iterator(folder / "printers", none)) {
      if (entry.path().extension() == ".json") names.push_back(entry.path().stem());
    }
  }
  std::sort(names.begin(), names.end());
  names.erase(std::unique(names.begin(), names.end()), names.end());
  return names;
}

}  // namespace vdbdither
