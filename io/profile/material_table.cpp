// Colours of the usual inks: the palette of the GrabCAD Voxel Print user guide.

#include "io/profile/material_table.h"

#include <algorithm>
#include <charconv>
#include <optional>

#include <nlohmann/json.hpp>

#include "io/file/file_name.h"
#include "vdbdither/engine/comma_list.h"
#include "vdbdither/engine/json_text.h"
#include "vdbdither/engine/option_values.h"
#include "vdbdither/model/errors.h"
#include "vdbdither/model/printable.h"
#include "vdbdither/model/words.h"

namespace vdbdither {

using nlohmann::ordered_json;

namespace {

const std::vector<Material>& usualInks() {
  static const std::vector<Material> inks = {
      {"white", {240, 240, 240, 255}}, {"VeroPureWht", {240, 240, 240, 255}},
      {"black", {26, 26, 29, 255}},    {"VeroBlack", {26, 26, 29, 255}},
      {"clear", {227, 233, 253, 255}}, {"VeroClear", {227, 233, 253, 255}},
      {"cyan", {0, 90, 158, 255}},     {"VeroCyan", {0, 90, 158, 255}},
      {"magenta", {166, 33, 98, 255}}, {"VeroMgnt", {166, 33, 98, 255}},
      {"yellow", {200, 189, 3, 255}},  {"VeroYellow", {200, 189, 3, 255}}};
  return inks;
}

/// A colour of four whole numbers from 0 to 255.
std::optional<std::array<std::uint8_t, 4>> rgbaOf(const ordered_json& json) {
  std::array<std::uint8_t, 4> rgba{};
  if (!json.is_array() || json.size() != rgba.size()) return std::nullopt;
  for (std::size_t channel = 0; channel < rgba.size(); ++channel) {
    const ordered_json& value = json[channel];
    if (!value.is_number_integer() || value < 0 || value > 255) return std::nullopt;
    rgba[channel] = value;
  }
  return rgba;
}

}  // namespace

bool sameName(std::string_view a, std::string_view b) {
  return equalsIgnoringCase(a, lowerCase(b));
}

const Material* materialCalled(std::string_view name, std::span<const Material> materials) {
  const auto find = [&](const auto& matches) -> const Material* {
    const auto found = std::find_if(materials.begin(), materials.end(), matches);
    return found == materials.end() ? nullptr : &*found;
  };
  const Material* exact = find([&](const Material& other) { return other.name == name; });
  return exact != nullptr ? exact
                          : find([&](const Material& other) { return sameName(other.name, name); });
}

std::int32_t addMaterial(MaterialTable& table, const Material& material) {
  const Material* same = materialCalled(material.name, table);
  if (same == nullptr) {
    table.push_back(material);
    return static_cast<std::int32_t>(table.size());
  }
  if (same->name != material.name)
    throw UsageError("'" + same->name + "' and '" + material.name +
                     "' differ by upper and lower case only; give one another name");
  if (same->rgba != material.rgba)
    throw UsageError("'" + material.name + "' has two colours; give one another name");
  return static_cast<std::int32_t>(same - table.data()) + 1;
}

std::optional<std::string> materialNameProblem(std::string_view name) {
  const auto is_plain = [](char c) {
    return (c >= '0' && c <= '9') || (c >= 'A' && c <= 'Z') || (c >= 'a' && c <= 'z') || c == '-' ||
           c == '_' || c == '.';
  };
  if (auto problem = fileNameProblem(name)) return problem;
  if (std::all_of(name.begin(), name.end(), is_plain) && name.front() != '.') return std::nullopt;
  return "cannot be given in options; use letters, digits, '-', '_' and '.'";
}

std::array<std::uint8_t, 4> parseColour(std::string_view text) {
  const UsageError error("'" + std::string(text) +
                         "' is not a colour; give #rrggbb or r,g,b of 0 to 255");
  std::array<std::uint8_t, 4> rgba = {0, 0, 0, 255};
  const bool hexadecimal = text.starts_with('#');
  if (hexadecimal) text.remove_prefix(1);
  std::size_t channels = 0;
  while (channels < 4) {
    const std::string_view part = text.substr(0, hexadecimal ? 2 : text.find(','));
    const char* end = part.data() + part.size();
    const auto [stop, failed] =
        std::from_chars(part.data(), end, rgba[channels], hexadecimal ? 16 : 10);
    if (failed != std::errc() || stop != end || (hexadecimal && part.size() != 2)) throw error;
    ++channels;
    text.remove_prefix(part.size());
    if (text.empty()) break;
    if (!hexadecimal) text.remove_prefix(1);
  }
  if (!text.empty() || channels < 3) throw error;
  return rgba;
}

std::string toJson(const MaterialTable& table) {
  ordered_json json = ordered_json::array();
  for (std::size_t i = 0; i < table.size(); ++i) {
    json.push_back({{"index", i + 1}, {"name", table[i].name}, {"rgba", table[i].rgba}});
  }
  return jsonText(json);
}

MaterialTable materialTableFromJson(const std::string& text) {
  const auto refusal = [](const std::string& why) {
    return DataError("the metadata " + std::string(materials_key) +
                     " is not a table of materials: " + why + "; assign the materials again");
  };
  MaterialTable table;
  const ordered_json json = parsedJson(text);
  if (json.is_discarded()) throw refusal(jsonProblem(text));
  if (!json.is_array()) throw refusal("it is not a JSON list");
  for (const ordered_json& entry : json) {
    if (!entry.is_object()) throw refusal("its entries are no JSON objects");
    const auto rgba = rgbaOf(entry.value("rgba", ordered_json()));
    const ordered_json name = entry.value("name", ordered_json());
    if (!rgba || !name.is_string())
      throw refusal("each material must have index, name and rgba, four numbers from 0 to 255");
    if (entry.value("index", ordered_json()) != table.size() + 1)
      throw refusal("its indices are not 1, 2, 3 …");
    table.push_back({printable(name.get<std::string>()), *rgba});
  }
  return table;
}

std::vector<std::string> materialEntries(const std::string& text) {
  std::vector<std::string> entries;
  for (const std::string& part : commaList(text)) {
    const bool number = !part.empty() && std::all_of(part.begin(), part.end(),
                                                     [](char c) { return c >= '0' && c <= '9'; });
    if (number && !entries.empty() && entries.back().find('=') != std::string::npos) {
      entries.back() += "," + part;
    } else {
      entries.push_back(part);
    }
  }
  return entries;
}

MaterialLayer parseMaterialLayer(const std::string& option, const std::string& text,
                                 double thickest_mm, const std::string& example) {
  const std::size_t colon = text.find(':');
  if (colon == std::string::npos)
    throw UsageError(option + ": '" + text + "' must be a thickness and a material, as in " +
                     example);
  try {
    return {parseLengthMm(text.substr(0, colon), Range::above(0, thickest_mm)),
            text.substr(colon + 1)};
  } catch (const UsageError& error) {
    throw UsageError(option + ": " + error.what());
  }
}

Material parseMaterial(std::string_view text, const std::vector<Material>& known) {
  Material material;
  const std::size_t equals = text.find('=');
  material.name = text.substr(0, equals);
  if (materialNameProblem(material.name)) {
    throw UsageError("'" + std::string(text) +
                     "' has no proper material name; use letters, digits, '-', '_' and '.'");
  }
  if (equals != std::string_view::npos) {
    material.rgba = parseColour(text.substr(equals + 1));
    return material;
  }
  std::vector<std::string> names;
  for (const std::vector<Material>* list : {&known, &usualInks()}) {
    if (const Material* found = materialCalled(material.name, *list)) return *found;
    for (const Material& candidate : *list) {
      if (std::find(names.begin(), names.end(), candidate.name) == names.end())
        names.push_back(candidate.name);
    }
  }
  std::string message = "no material '" + material.name + "'; there are";
  for (const std::string& name : names) message += " " + name;
  throw UsageError(message + ", and any other with its colour, as in " + material.name +
                   "=#rrggbb");
}

}  // namespace vdbdither
