#include "io/profile/profile_parser.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <sstream>
#include <utility>

#include "io/file/file_name.h"
#include "io/profile/material_table.h"
#include "io/profile/printer_profile.h"
#include "vdbdither/engine/options.h"
#include "vdbdither/model/errors.h"
#include "vdbdither/model/printable.h"
#include "vdbdither/model/words.h"

namespace vdbdither {

using nlohmann::ordered_json;

namespace {

constexpr int most_px = 1 << 24;

/// A whole number within a range; 3.0 is one.
std::optional<int> wholeNumber(const ordered_json& json, int least, int most) {
  if (!json.is_number()) return std::nullopt;
  const double value = json.get<double>();
  if (!(value >= least && value <= most) || value != std::floor(value)) return std::nullopt;
  return static_cast<int>(value);
}

/// Three numbers within a range.
std::optional<openvdb::Vec3d> numbers(const ordered_json& json, double least, double most) {
  openvdb::Vec3d result(0.0);
  if (!json.is_array() || json.size() != 3) return std::nullopt;
  for (int channel = 0; channel < 3; ++channel) {
    const ordered_json& value = json[channel];
    if (!value.is_number() || value < least || value > most) return std::nullopt;
    result[channel] = value;
  }
  return result;
}

/// A length as a number of mm or a text with a unit.
std::optional<double> lengthMm(const ordered_json& json) {
  if (json.is_number()) return json.get<double>();
  if (!json.is_string()) return std::nullopt;
  try {
    return parseLengthMm(json.get<std::string>());
  } catch (const UsageError&) {
    return std::nullopt;
  }
}

}  // namespace

std::span<const std::string> containerNames() {
  static const std::vector<std::string> names{"3mf",  "exr", "gcvf", "objet", "png", "png1",
                                              "png8", "sl1", "tiff", "tiff1", "uvj"};
  return names;
}

ProfileParser::ProfileParser(const ordered_json& json) {
  if (!json.is_object()) {
    problems_.push_back({{}, "the text is not a JSON object"});
    return;
  }
  const Object object{json, {}, ""};
  known(object, {"$schema",         "name",
                 "title",           "source",
                 "technology",      "pitch_mm",
                 "layer_mm",        "build_mm",
                 "slice_px",        "origin",
                 "mirror_x",        "mirror_y",
                 "minimum_slices",  "maximum_colours",
                 "containers",      "printer_notes",
                 "point_spread_mm", "yule_nielsen",
                 "kubelka_munk",    "materials"});
  identity(object);
  layers(object);
  slices(object);
  optics(object);
  if (!object.has("materials")) return;
  const ordered_json& materials = object["materials"];
  if (!materials.is_array()) {
    problem(object, "materials", "materials is no list");
    return;
  }
  for (const ordered_json& entry : materials) {
    const std::size_t index = profile_.materials.size();
    material({entry,
              {"materials", std::to_string(index)},
              "material " + std::to_string(index + 1) + ": "});
  }
}

/// Notes a problem with the value of `key`, or with the object itself where it is empty.
void ProfileParser::problem(const Object& object, const std::string& key,
                            const std::string& message) {
  std::vector<std::string> path = object.path;
  if (!key.empty()) path.push_back(key);
  problems_.push_back({std::move(path), object.prefix + message});
}

/// Notes keys that nobody reads: they may be misspelt.
void ProfileParser::known(const Object& object, const std::vector<std::string>& keys) {
  std::string accepted;
  for (const std::string& key : keys) accepted += (accepted.empty() ? "" : ", ") + key;
  for (const auto& [key, value] : object.json.items()) {
    if (std::find(keys.begin(), keys.end(), key) != keys.end()) continue;
    const std::string near = nearestWord(key, keys);
    problem(object, key,
            "'" + key + "' means nothing here; " +
                (near.empty() ? "accepted are " + accepted : "did you mean '" + near + "'?"));
  }
}

std::string ProfileParser::text(const Object& object, const std::string& key) {
  if (!object.has(key)) return "";
  if (object[key].is_string()) return printable(object[key].get<std::string>());
  problem(object, key, key + " is no text");
  return "";
}

/// \param name_problem  tells what is wrong with a name that is not empty
std::string ProfileParser::name(
    const Object& object,
    const std::function<std::optional<std::string>(std::string_view)>& name_problem) {
  std::string name = text(object, "name");
  if (!object.has("name")) {
    problem(object, "name", "there is no name");
  } else if (const auto wrong = name_problem(name); wrong && !name.empty()) {
    problem(object, "name", "its name " + *wrong);
  }
  return name;
}

/// One of the `words`, or `otherwise` where the key is missing.
std::string ProfileParser::word(const Object& object, const std::string& key,
                                const std::vector<std::string>& words,
                                const std::string& otherwise) {
  if (!object.has(key)) return otherwise;
  std::string accepted;
  for (const std::string& word : words) {
    if (object[key] == word) return word;
    accepted += (accepted.empty() ? "" : " or ") + word;
  }
  problem(object, key, key + " must be " + accepted);
  return otherwise;
}

bool ProfileParser::flag(const Object& object, const std::string& key) {
  if (!object.has(key)) return false;
  if (object[key].is_boolean()) return object[key];
  problem(object, key, key + " must be true or false");
  return false;
}

/// A whole number above 0, or 0 where the key is missing.
int ProfileParser::count(const Object& object, const std::string& key) {
  if (!object.has(key)) return 0;
  const std::optional<int> number = wholeNumber(object[key], 1, most_px);
  if (!number)
    problem(object, key, key + " must be a whole number from 1 to " + std::to_string(most_px));
  return number.value_or(0);
}

/// As many lengths as `number`; zeros where they are wrong.
std::vector<double> ProfileParser::lengths(const Object& object, const std::string& key,
                                           std::size_t number, double min_mm, double max_mm) {
  std::vector<double> result(number, 0.0);
  const ordered_json list = object.has(key) ? object[key] : ordered_json();
  bool proper = list.is_array() && list.size() == number;
  for (std::size_t at = 0; proper && at < number; ++at) {
    const std::optional<double> mm = lengthMm(list[at]);
    proper = mm && *mm >= min_mm && *mm <= max_mm;
    if (proper) result[at] = *mm;
  }
  if (proper) return result;
  std::ostringstream message;
  message << key << " must be " << (number == 2 ? "two" : "three") << " lengths between " << min_mm
          << " and " << max_mm << " mm";
  problem(object, key, message.str());
  return std::vector<double>(number, 0.0);
}

openvdb::Vec3d ProfileParser::lengths3(const Object& object, const std::string& key, double min_mm,
                                       double max_mm) {
  const std::vector<double> mm = lengths(object, key, 3, min_mm, max_mm);
  return {mm[0], mm[1], mm[2]};
}

void ProfileParser::identity(const Object& object) {
  (void)text(object, "$schema");  // for editors
  profile_.name = name(object, fileNameProblem);
  profile_.title = object.has("title") ? text(object, "title") : profile_.name;
  profile_.source = text(object, "source");
  profile_.technology = word(object, "technology", {"jetting", "resin"}, "");
}

void ProfileParser::layers(const Object& object) {
  constexpr double least_mm = 1e-4;
  constexpr double most_mm = 100;
  profile_.pitch_mm = lengths3(object, "pitch_mm", least_mm, most_mm);
  if (!object.has("layer_mm")) return;
  const std::vector<double> range = lengths(object, "layer_mm", 2, least_mm, most_mm);
  if (range[0] == 0) return;
  profile_.layer_mm.emplace(range[0], range[1]);
  if (range[0] > range[1]) {
    problem(object, "layer_mm", "layer_mm must begin with the lowest layer");
  } else if (const double mm = profile_.pitch_mm[2]; mm != 0 && (mm < range[0] || mm > range[1])) {
    problem(object, "layer_mm",
            "layer_mm must include the layer of pitch_mm, " + shortestText(mm) + " mm");
  }
}

void ProfileParser::slices(const Object& object) {
  constexpr double most_build_mm = 1e5;
  if (object.has("build_mm")) profile_.build_mm = lengths3(object, "build_mm", 0, most_build_mm);
  if (object.has("slice_px")) {
    const ordered_json& px = object["slice_px"];
    const bool two = px.is_array() && px.size() == 2;
    const auto columns = two ? wholeNumber(px[0], 1, most_px) : std::nullopt;
    const auto rows = two ? wholeNumber(px[1], 1, most_px) : std::nullopt;
    if (columns && rows) {
      profile_.slice_px = {*columns, *rows};
    } else {
      problem(object, "slice_px",
              "slice_px must be two whole numbers from 1 to " + std::to_string(most_px) +
                  ", columns and rows");
    }
  }
  profile_.origin = word(object, "origin", {"corner", "centre"}, "corner");
  profile_.mirror_x = flag(object, "mirror_x");
  profile_.mirror_y = flag(object, "mirror_y");
  profile_.minimum_slices = count(object, "minimum_slices");
  profile_.maximum_colours = count(object, "maximum_colours");
  profile_.printer_notes = text(object, "printer_notes");
  if (!object.has("containers")) return;
  const ordered_json& names = object["containers"];
  const bool proper =
      names.is_array() && std::all_of(names.begin(), names.end(), [&](auto& name) {
        return name.is_string() && name != "" && std::count(names.begin(), names.end(), name) == 1;
      });
  if (!proper) return problem(object, "containers", "containers must be a list of different names");
  for (const ordered_json& entry : names) {
    const std::string name = printable(entry.get<std::string>());
    profile_.containers.push_back(name);
    const std::span<const std::string> known = containerNames();
    if (std::find(known.begin(), known.end(), name) == known.end()) {
      problem(object, "containers",
              "containers: '" + name + "' is not a slice format; give " + alternatives(known));
    }
  }
}

void ProfileParser::optics(const Object& object) {
  if (object.has("point_spread_mm"))
    profile_.point_spread_mm = lengths3(object, "point_spread_mm", least_spread_mm, most_spread_mm);
  if (object.has("yule_nielsen")) {
    constexpr double most_factor = 16;
    ordered_json factors = object["yule_nielsen"];
    if (factors.is_number()) factors = {factors, factors, factors};
    const auto triple = numbers(factors, 1, most_factor);
    if (!triple)
      problem(object, "yule_nielsen",
              "yule_nielsen must be a number from 1 to 16, or three of them");
    profile_.yule_nielsen = triple.value_or(profile_.yule_nielsen);
  }
  if (!object.has("kubelka_munk")) return;
  const ordered_json& mirror = object["kubelka_munk"];
  if (!mirror.is_object())
    return problem(object, "kubelka_munk", "kubelka_munk must be an object with outer and inner");
  this->mirror({mirror, {"kubelka_munk"}, "kubelka_munk: "});
}

void ProfileParser::mirror(const Object& entry) {
  constexpr double most = 0.99;
  known(entry, {"outer", "inner"});
  const ordered_json outer = entry.json.value("outer", ordered_json());
  const auto inner = numbers(entry.json.value("inner", ordered_json()), 0, most);
  if (!outer.is_number() || outer < 0 || outer > most || !inner)
    return problem(entry, "", "outer must be a number and inner three, from 0 to 0.99");
  profile_.kubelka_munk = {outer, *inner};
}

/// Reads three numbers of a material that are not negative.
std::optional<openvdb::Vec3d> ProfileParser::coefficients(const Object& entry,
                                                          const std::string& key) {
  constexpr double most = 1e9;
  if (!entry.has(key)) return std::nullopt;
  auto triple = numbers(entry[key], 0, most);
  if (!triple) problem(entry, key, key + " must be three numbers from 0 to 1e9");
  return triple;
}

void ProfileParser::material(const Object& entry) {
  Material& material = profile_.materials.emplace_back();
  if (!entry.json.is_object()) return problem(entry, "", "it is not a JSON object");
  known(entry,
        {"name", "rgba", "linear_rgb", "absorption", "scattering", "density_g_per_cm3", "resin"});
  material.name = name(entry, materialNameProblem);
  if (material.name.empty() && entry.has("name") && entry["name"].is_string())
    problem(entry, "name", "there is no name");
  material.resin = text(entry, "resin");
  appearance(entry, material);
  remarkColour(entry, material);
  if (entry.has("density_g_per_cm3")) {
    constexpr double most = 100;
    const ordered_json& density = entry["density_g_per_cm3"];
    if (density.is_number() && density > 0 && density <= most) {
      material.density_g_per_cm3 = density;
    } else {
      problem(entry, "density_g_per_cm3", "density_g_per_cm3 must be a number above 0, up to 100");
    }
  }
  if (material.name.empty()) return;
  const std::span<const Material> others(profile_.materials.data(), profile_.materials.size() - 1);
  const Material* other = materialCalled(material.name, others);
  if (other == nullptr) return;
  problem(entry, "name",
          "'" + material.name + "' " +
              (other->name == material.name
                   ? "is there twice"
                   : "differs from '" + other->name + "' by upper and lower case only"));
}

/// Remarks that the material has the colour of empty voxels, or of a material before it.
void ProfileParser::remarkColour(const Object& entry, const Material& material) {
  const auto remark = [&](const std::string& text) {
    std::vector<std::string> path = entry.path;
    path.emplace_back("rgba");
    remarks_.push_back({std::move(path), entry.prefix + "'" + material.name + "' has " + text});
  };
  if (material.rgba == parseColour(usual_background))
    remark("the colour of empty voxels; give slice-export another --background");
  const std::span<const Material> others(profile_.materials.data(), profile_.materials.size() - 1);
  const auto same = std::find_if(others.begin(), others.end(), [&](const Material& other) {
    return other.rgba == material.rgba;
  });
  if (same == others.end()) return;
  remark("the colour of '" + same->name +
         "', so that formats that tell materials apart by colour, such as png and gcvf, refuse "
         "jobs of both");
}

void ProfileParser::appearance(const Object& entry, Material& material) {
  material.absorption = coefficients(entry, "absorption");
  material.scattering = coefficients(entry, "scattering");
  if (entry.has("absorption") != entry.has("scattering"))
    problem(entry, "", "absorption and scattering go together");
  constexpr int most = 255;
  const ordered_json rgba = entry.json.value("rgba", ordered_json());
  bool proper = rgba.is_array() && rgba.size() == material.rgba.size();
  for (std::size_t channel = 0; proper && channel < material.rgba.size(); ++channel) {
    const std::optional<int> value = wholeNumber(rgba[channel], 0, most);
    proper = value.has_value();
    if (value) material.rgba[channel] = static_cast<std::uint8_t>(*value);
  }
  if (!proper) problem(entry, "rgba", "rgba must be four whole numbers from 0 to 255");
  if (!entry.has("linear_rgb")) return;
  material.linear_rgb = numbers(entry["linear_rgb"], 0, 1);
  if (!material.linear_rgb)
    problem(entry, "linear_rgb", "linear_rgb must be three numbers from 0 to 1");
}

}  // namespace vdbdither
