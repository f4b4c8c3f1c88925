#include "io/printer_profile.h"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <sstream>

#include <nlohmann/json.hpp>

#include "io/data_files.h"
#include "vdbdither/errors.h"
#include "vdbdither/options.h"

namespace vdbdither {

using nlohmann::ordered_json;

namespace {

openvdb::Vec3d lengths(const ordered_json& values) {
  openvdb::Vec3d result;
  for (int axis = 0; axis < 3; ++axis) {
    const ordered_json& value = values.at(axis);
    result[axis] =
        value.is_string() ? parseLengthMm(value.get<std::string>()) : value.get<double>();
  }
  return result;
}

PrinterProfile parse(const std::string& text) {
  const ordered_json json = ordered_json::parse(text);
  PrinterProfile profile;
  profile.name = json.at("name");
  profile.title = json.value("title", profile.name);
  profile.source = json.value("source", "");
  profile.pitch_mm = lengths(json.at("pitch_mm"));
  if (json.contains("build_mm")) profile.build_mm = lengths(json.at("build_mm"));
  if (json.contains("point_spread_mm"))
    profile.point_spread_mm = lengths(json.at("point_spread_mm"));
  for (const ordered_json& entry : json.value("materials", ordered_json::array())) {
    Material material;
    material.name = entry.at("name");
    const ordered_json& rgba = entry.at("rgba");
    for (std::size_t channel = 0; channel < 4; ++channel) material.rgba[channel] = rgba.at(channel);
    profile.materials.push_back(material);
  }
  for (int axis = 0; axis < 3; ++axis) {
    if (!(profile.pitch_mm[axis] >= 1e-4 && profile.pitch_mm[axis] <= 100)) {
      throw UsageError("pitch_mm must be three lengths between 0.0001 and 100 mm");
    }
    if (!(profile.point_spread_mm[axis] >= 0 && profile.point_spread_mm[axis] <= 10)) {
      throw UsageError("point_spread_mm must be three lengths up to 10 mm");
    }
  }
  return profile;
}

}  // namespace

PrinterProfile readPrinterProfile(const std::string& name_or_path) {
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
  std::ifstream file(path);
  if (!file) throw UsageError("no such printer profile '" + path.string() + "'");
  std::ostringstream text;
  text << file.rdbuf();
  try {
    return parse(text.str());
  } catch (const std::exception& error) {
    throw DataError("'" + path.string() + "' is not a printer profile: " + error.what());
  }
}

std::string toJson(const PrinterProfile& profile) {
  ordered_json json;
  json["name"] = profile.name;
  json["title"] = profile.title;
  json["source"] = profile.source;
  json["pitch_mm"] = {profile.pitch_mm[0], profile.pitch_mm[1], profile.pitch_mm[2]};
  json["build_mm"] = {profile.build_mm[0], profile.build_mm[1], profile.build_mm[2]};
  if (!profile.point_spread_mm.isZero()) {
    json["point_spread_mm"] = {profile.point_spread_mm[0], profile.point_spread_mm[1],
                               profile.point_spread_mm[2]};
  }
  json["materials"] = ordered_json::array();
  for (const Material& material : profile.materials) {
    json["materials"].push_back({{"name", material.name}, {"rgba", material.rgba}});
  }
  return json.dump();
}

PrinterProfile printerProfileFromJson(const std::string& text) {
  try {
    return parse(text);
  } catch (const std::exception& error) {
    throw DataError(std::string("the metadata vdbdither:printer is not a printer profile: ") +
                    error.what());
  }
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
