#include "io/profile/printer_profile.h"

#include <algorithm>
#include <filesystem>
#include <optional>
#include <utility>

#include <nlohmann/json.hpp>

#include "io/file/data_files.h"
#include "io/file/whole_file.h"
#include "io/profile/json_lines.h"
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

struct CheckedProfile {
  PrinterProfile profile;
  ProfileFindings findings;
};

/// In the order of the lines.
std::vector<std::string> textsOf(std::vector<std::pair<int, std::string>> by_line) {
  std::stable_sort(by_line.begin(), by_line.end(),
                   [](const auto& a, const auto& b) { return a.first < b.first; });
  std::vector<std::string> texts;
  texts.reserve(by_line.size());
  for (const auto& [line, message] : by_line)
    texts.push_back("line " + std::to_string(line) + ": " + message);
  return texts;
}

/// \param stem  the name of the file without its ending, if the profile must have it
CheckedProfile checkedProfile(const std::string& text,
                              const std::optional<std::string>& stem = std::nullopt) {
  if (std::string problem = jsonProblem(text); !problem.empty())
    return {{}, {{std::move(problem)}, {}}};
  const ordered_json json = parsedJson(text);
  const ProfileParser parser(json);
  std::vector<ProfileProblem> problems = parser.problems();
  const std::string& name = parser.profile().name;
  const bool is_named = json.is_object() && json.contains("name") && json["name"].is_string();
  if (stem && is_named && name != *stem)
    problems.push_back({{"name"}, "its name '" + name + "' is not that of its file"});
  const JsonLines lines = jsonLines(text);
  std::vector<std::pair<int, std::string>> by_line;
  for (const auto& [line, key] : lines.repeated)
    by_line.emplace_back(line, "'" + key + "' is there twice");
  for (const ProfileProblem& problem : problems)
    by_line.emplace_back(lines.of(problem.path), problem.message);
  std::vector<std::pair<int, std::string>> remarks;
  for (const ProfileProblem& remark : parser.remarks())
    remarks.emplace_back(lines.of(remark.path), remark.message);
  return {parser.profile(), {textsOf(std::move(by_line)), textsOf(std::move(remarks))}};
}

/// The file that `name_or_path` names and what it holds.
std::pair<std::filesystem::path, std::string> readProfile(const std::string& name_or_path) {
  std::filesystem::path path = name_or_path;
  if (!name_or_path.ends_with(".json")) {
    const std::vector<std::string> names = installedPrinters();
    if (std::find(names.begin(), names.end(), name_or_path) == names.end()) {
      if (names.empty()) {
        throw UsageError("no printer '" + name_or_path +
                         "': no profiles are installed, or share/vdbdither is not beside the "
                         "program; set VDBDITHER_DATA to it, or name a profile file ending in "
                         ".json");
      }
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
  CheckedProfile checked = checkedProfile(text);
  const std::vector<std::string>& problems = checked.findings.problems;
  if (problems.empty()) return std::move(checked.profile);
  std::string message = "'" + path.string() + "' is not a printer profile: " + problems.front();
  if (const std::size_t more = problems.size() - 1; more > 0)
    message += " (and " + std::to_string(more) + " more; `vdbdither printers check` lists them)";
  throw DataError(message);
}

ProfileFindings printerProfileFindings(const std::string& name_or_path) {
  const auto [path, text] = readProfile(name_or_path);
  return checkedProfile(text, path.stem().string()).findings;
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
  const auto refusal = [](const std::string& why) {
    return DataError("the metadata vdbdither:printer is not a printer profile: " + why);
  };
  const ordered_json json = parsedJson(text);
  if (json.is_discarded()) throw refusal(jsonProblem(text));
  const ProfileParser parser(json);
  if (!parser.problems().empty()) throw refusal(parser.problems().front().message);
  return parser.profile();
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
  for (const std::filesystem::path& data : dataFolders()) {
    const std::filesystem::path folder = data / "printers";
    std::error_code error;
    const std::filesystem::directory_iterator entries(folder, error);
    if (error && error != std::errc::no_such_file_or_directory &&
        error != std::errc::not_a_directory)
      throw DataError("cannot read '" + folder.string() + "': " + error.message());
    for (const auto& entry : entries) {
      const bool is_profile =
          entry.path().extension() == ".json" && entry.path().stem() != "schema";
      if (is_profile) names.push_back(entry.path().stem());
    }
  }
  std::sort(names.begin(), names.end());
  names.erase(std::unique(names.begin(), names.end()), names.end());
  return names;
}

}  // namespace vdbdither
