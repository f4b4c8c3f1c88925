#include "io/profile/printer_profile.h"

#include <algorithm>
#include <filesystem>
#include <optional>
#include <sstream>

#include <nlohmann/json.hpp>

#include "io/file/data_files.h"
#include "io/file/file_name.h"
#include "io/file/whole_file.h"
#include "vdbdither/engine/json_text.h"
#include "vdbdither/engine/options.h"
#include "vdbdither/model/errors.h"
#include "vdbdither/model/known_grids.h"
#include "vdbdither/model/printable.h"

namespace vdbdither {

using nlohmann::ordered_json;

namespace {

/// Reads a profile and notes everything that is wrong with it, rather than the first.
class ProfileParser {
 public:
  explicit ProfileParser(const std::string& text) {
    const ordered_json json = parsedJson(text);
    if (!json.is_object()) {
      problems_.emplace_back("the text is not a JSON object");
      return;
    }
    known(json,
          {"name", "title", "source", "pitch_mm", "build_mm", "point_spread_mm", "yule_nielsen",
           "kubelka_munk", "materials"},
          "");
    profile_.name = this->text(json, "name", "");
    if (!json.contains("name")) problems_.emplace_back("there is no name");
    if (const auto problem = fileNameProblem(profile_.name); problem && !profile_.name.empty())
      problems_.push_back("its name " + *problem);
    profile_.title = json.contains("title") ? this->text(json, "title", "") : profile_.name;
    profile_.source = json.contains("source") ? this->text(json, "source", "") : "";
    profile_.pitch_mm = lengths(json, "pitch_mm", 1e-4, 100);
    if (json.contains("build_mm")) profile_.build_mm = lengths(json, "build_mm", 0, 1e5);
    if (json.contains("point_spread_mm"))
      profile_.point_spread_mm = lengths(json, "point_spread_mm", 0, 10);
    if (json.contains("yule_nielsen")) {
      ordered_json factors = json["yule_nielsen"];
      if (factors.is_number()) factors = {factors, factors, factors};
      constexpr double most = 16;
      const auto triple = numbers(factors, 1, most);
      if (!triple)
        problems_.emplace_back("yule_nielsen must be a number from 1 to 16, or three of them");
      profile_.yule_nielsen = triple.value_or(profile_.yule_nielsen);
    }
    if (json.contains("kubelka_munk")) mirror(json["kubelka_munk"]);
    const ordered_json materials = json.value("materials", ordered_json::array());
    if (!materials.is_array()) problems_.emplace_back("materials is no list");
    for (const ordered_json& entry : materials) material(entry);
  }

  [[nodiscard]] const PrinterProfile& profile() const { return profile_; }
  [[nodiscard]] const std::vector<std::string>& problems() const { return problems_; }

 private:
  /// Notes keys that nobody reads: they may be misspelt.
  void known(const ordered_json& json, const std::vector<std::string>& keys,
             const std::string& where) {
    for (const auto& [key, value] : json.items()) {
      if (std::find(keys.begin(), keys.end(), key) != keys.end()) continue;
      const std::string near = nearestWord(key, keys);
      problems_.push_back(where + "'" + key + "' means nothing here" +
                          (near.empty() ? "" : "; did you mean '" + near + "'?"));
    }
  }

  std::string text(const ordered_json& json, const char* key, const std::string& where) {
    if (json.contains(key) && json[key].is_string()) return printable(json[key].get<std::string>());
    if (json.contains(key)) problems_.push_back(where + key + " is no text");
    return "";
  }

  openvdb::Vec3d lengths(const ordered_json& json, const std::string& key, double min_mm,
                         double max_mm) {
    openvdb::Vec3d result(0.0);
    std::ostringstream problem_text;
    problem_text << key << " must be three lengths between " << min_mm << " and " << max_mm
                 << " mm";
    const std::string problem = problem_text.str();
    if (!json.contains(key) || !json[key].is_array() || json[key].size() != 3) {
      problems_.push_back(problem);
      return result;
    }
    bool proper = true;
    for (int axis = 0; axis < 3; ++axis) {
      const ordered_json& value = json[key][axis];
      try {
        result[axis] = value.is_string()   ? parseLengthMm(value.get<std::string>())
                       : value.is_number() ? value.get<double>()
                                           : -1;
      } catch (const UsageError&) {
        proper = false;
      }
      proper &= result[axis] >= min_mm && result[axis] <= max_mm;
    }
    if (!proper) problems_.push_back(problem);
    return result;
  }

  /// Three numbers within a range.
  static std::optional<openvdb::Vec3d> numbers(const ordered_json& json, double least,
                                               double most) {
    openvdb::Vec3d result(0.0);
    if (!json.is_array() || json.size() != 3) return std::nullopt;
    for (int channel = 0; channel < 3; ++channel) {
      const ordered_json& value = json[channel];
      if (!value.is_number() || value < least || value > most) return std::nullopt;
      result[channel] = value;
    }
    return result;
  }

  void mirror(const ordered_json& entry) {
    SurfaceMirror& mirror = profile_.kubelka_munk.emplace();
    constexpr double most = 0.99;
    if (!entry.is_object()) {
      problems_.emplace_back("kubelka_munk must be an object with outer and inner");
      return;
    }
    known(entry, {"outer", "inner"}, "kubelka_munk: ");
    const ordered_json outer = entry.value("outer", ordered_json());
    const auto inner = numbers(entry.value("inner", ordered_json()), 0, most);
    if (!outer.is_number() || outer < 0 || outer > most || !inner) {
      problems_.emplace_back(
          "kubelka_munk: outer must be a number and inner three, from 0 to 0.99");
      return;
    }
    mirror = {outer, *inner};
  }

  /// Reads three numbers of a material that are not negative.
  std::optional<openvdb::Vec3d> coefficients(const ordered_json& entry, const char* key,
                                             const std::string& where) {
    constexpr double most = 1e9;
    if (!entry.contains(key)) return std::nullopt;
    auto triple = numbers(entry[key], 0, most);
    if (!triple) problems_.push_back(where + key + " must be three numbers from 0 to 1e9");
    return triple;
  }

  void material(const ordered_json& entry) {
    const std::string where = "material " + std::to_string(profile_.materials.size() + 1) + ": ";
    Material& material = profile_.materials.emplace_back();
    if (!entry.is_object()) {
      problems_.push_back(where + "it is not a JSON object");
      return;
    }
    known(entry, {"name", "rgba", "linear_rgb", "absorption", "scattering"}, where);
    material.absorption = coefficients(entry, "absorption", where);
    material.scattering = coefficients(entry, "scattering", where);
    if (entry.contains("absorption") != entry.contains("scattering"))
      problems_.push_back(where + "absorption and scattering go together");
    material.name = text(entry, "name", where);
    if (material.name.empty()) problems_.push_back(where + "there is no name");
    if (const auto problem = fileNameProblem(material.name); problem && !material.name.empty())
      problems_.push_back(where + "its name " + *problem);
    const ordered_json rgba = entry.value("rgba", ordered_json());
    bool proper = rgba.is_array() && rgba.size() == 4;
    for (std::size_t channel = 0; proper && channel < 4; ++channel) {
      proper = rgba[channel].is_number_integer() && rgba[channel] >= 0 && rgba[channel] <= 255;
      if (proper) material.rgba[channel] = rgba[channel];
    }
    if (!proper) problems_.push_back(where + "rgba must be four whole numbers from 0 to 255");
    if (entry.contains("linear_rgb")) {
      material.linear_rgb = numbers(entry["linear_rgb"], 0, 1);
      if (!material.linear_rgb)
        problems_.push_back(where + "linear_rgb must be three numbers from 0 to 1");
    }
    for (auto other = profile_.materials.begin(); &*other != &material; ++other) {
      if (other->name == material.name)
        problems_.push_back(where + "'" + material.name + "' is there twice");
    }
  }

  PrinterProfile profile_;
  std::vector<std::string> problems_;
};

ordered_json tripleOf(const openvdb::Vec3d& numbers) {
  return {numbers[0], numbers[1], numbers[2]};
}

PrinterProfile parse(const std::string& text) {
  const ProfileParser parser(text);
  if (!parser.problems().empty()) throw DataError(parser.problems().front());
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
  const ProfileParser parser(text);
  std::vector<std::string> problems = parser.problems();
  if (!parser.profile().name.empty() && parser.profile().name != path.stem())
    problems.push_back("its name '" + parser.profile().name + "' is not that of its file");
  return problems;
}

std::string toJson(const PrinterProfile& profile) {
  ordered_json json;
  json["name"] = profile.name;
  json["title"] = profile.title;
  json["source"] = profile.source;
  json["pitch_mm"] = tripleOf(profile.pitch_mm);
  json["build_mm"] = tripleOf(profile.build_mm);
  if (!profile.point_spread_mm.isZero())
    json["point_spread_mm"] = tripleOf(profile.point_spread_mm);
  if (profile.yule_nielsen != PrinterProfile().yule_nielsen)
    json["yule_nielsen"] = tripleOf(profile.yule_nielsen);
  if (const auto& mirror = profile.kubelka_munk)
    json["kubelka_munk"] = {{"outer", mirror->outer}, {"inner", tripleOf(mirror->inner)}};
  json["materials"] = ordered_json::array();
  for (const Material& material : profile.materials) {
    ordered_json& entry = json["materials"].emplace_back(
        ordered_json{{"name", material.name}, {"rgba", material.rgba}});
    if (material.linear_rgb) entry["linear_rgb"] = tripleOf(*material.linear_rgb);
    if (material.absorption) entry["absorption"] = tripleOf(*material.absorption);
    if (material.scattering) entry["scattering"] = tripleOf(*material.scattering);
  }
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
