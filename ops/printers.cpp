#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "io/file/data_files.h"
#include "io/file/file_name.h"
#include "io/file/staged_output.h"
#include "io/file/standard_streams.h"
#include "io/file/text_bytes.h"
#include "io/profile/printer_profile.h"
#include "vdbdither/engine/json_text.h"
#include "vdbdither/engine/option_groups.h"
#include "vdbdither/engine/tool.h"
#include "vdbdither/model/errors.h"
#include "vdbdither/model/printable.h"

namespace vdbdither {

namespace {

using nlohmann::ordered_json;

enum class Action { list, show, check, create };
constexpr std::array<Choice<Action>, 4> actions{
    {{Action::list, "list", "Lists the installed printers"},
     {Action::show, "show", "Describes a printer"},
     {Action::check, "check", "Lists the problems of a profile, by line"},
     {Action::create, "new", "Writes a profile to fill in"}}};

/// To the nanometre.
std::string lengthText(double mm) { return shortestText(std::round(mm * 1e6) / 1e6); }

std::string lengthsText(const openvdb::Vec3d& mm) {
  return lengthText(mm[0]) + " x " + lengthText(mm[1]) + " x " + lengthText(mm[2]) + " mm";
}

std::string numbersText(const openvdb::Vec3d& numbers) {
  return shortestText(numbers[0]) + ", " + shortestText(numbers[1]) + ", " +
         shortestText(numbers[2]);
}

/// A description in lines that begin with what they describe.
class Description {
 public:
  void line(const std::string& label, const std::string& text) {
    constexpr std::size_t column = 12;
    text_ += label + std::string(column - label.size(), ' ') + text + "\n";
  }
  /// The same where there is something to say.
  void lineIfKnown(const std::string& label, const std::string& text) {
    if (!text.empty()) line(label, text);
  }
  [[nodiscard]] const std::string& text() const { return text_; }

 private:
  std::string text_;
};

std::string slicesText(const PrinterProfile& profile) {
  std::vector<std::string> facts;
  if (!profile.slice_px.isZero())
    facts.push_back(std::to_string(profile.slice_px[0]) + " x " +
                    std::to_string(profile.slice_px[1]) + " pixels");
  if (profile.mirror_x) facts.emplace_back("mirrored in x");
  if (profile.mirror_y) facts.emplace_back("mirrored in y");
  if (profile.minimum_slices > 0)
    facts.push_back("at least " + std::to_string(profile.minimum_slices) + " of them");
  if (profile.maximum_colours > 0)
    facts.push_back("at most " + std::to_string(profile.maximum_colours) +
                    (profile.maximum_colours == 1 ? " colour" : " colours"));
  std::string text;
  for (const std::string& fact : facts) text += (text.empty() ? "" : ", ") + fact;
  return text;
}

void describeOptics(const PrinterProfile& profile, Description& description) {
  if (!profile.point_spread_mm.isZero())
    description.line("spread", lengthsText(profile.point_spread_mm));
  if (profile.yule_nielsen != PrinterProfile().yule_nielsen)
    description.line("mixing", "Yule-Nielsen factor " + numbersText(profile.yule_nielsen));
  if (const auto& mirror = profile.kubelka_munk)
    description.line("mixing", "Kubelka-Munk, surface mirrors " + shortestText(mirror->outer) +
                                   " outside, " + numbersText(mirror->inner) + " inside");
}

std::string materialText(const Material& material) {
  std::string text = material.name;
  for (std::size_t channel = 0; channel < material.rgba.size(); ++channel)
    text += (channel == 0 ? " " : ",") + std::to_string(material.rgba[channel]);
  if (!material.resin.empty()) text += ", resin " + material.resin;
  if (material.density_g_per_cm3)
    text += ", " + shortestText(*material.density_g_per_cm3) + " g/cm3";
  if (material.linear_rgb) text += ", measured " + numbersText(*material.linear_rgb);
  if (material.absorption) text += ", absorption " + numbersText(*material.absorption);
  if (material.scattering) text += ", scattering " + numbersText(*material.scattering);
  return text;
}

std::string describe(const PrinterProfile& profile) {
  Description description;
  description.line("name", profile.name);
  description.line("title", profile.title);
  description.lineIfKnown("technology", profile.technology);
  description.line("pitch", lengthsText(profile.pitch_mm));
  if (const auto& range = profile.layer_mm)
    description.line("layers", lengthText((*range)[0]) + " to " + lengthText((*range)[1]) + " mm");
  if (!profile.build_mm.isZero()) description.line("build", lengthsText(profile.build_mm));
  description.line("origin", profile.origin);
  description.lineIfKnown("slices", slicesText(profile));
  std::string containers;
  for (const std::string& name : profile.containers)
    containers += (containers.empty() ? "" : ", ") + name;
  description.lineIfKnown("containers", containers);
  description.lineIfKnown("notes", profile.printer_notes);
  describeOptics(profile, description);
  const char* label = "materials";
  for (const Material& material : profile.materials) {
    description.line(label, materialText(material));
    label = "";
  }
  description.lineIfKnown("source", profile.source);
  return description.text();
}

/// A valid profile called `name` with the fields that most printers need.
std::string profileToFillIn(const std::string& name) {
  const std::string quoted = jsonText(name);
  return R"({
  "name": )" +
         quoted + R"(,
  "title": )" +
         quoted + R"(,
  "source": "to be filled in: where these figures are from",
  "technology": "jetting",
  "pitch_mm": ["42um", "84um", "22um"],
  "build_mm": [500, 400, 200],
  "materials": [
    { "name": "white", "rgba": [240, 240, 240, 255] },
    { "name": "black", "rgba": [26, 26, 29, 255] }
  ]
}
)";
}

/// The profiles there are, one of them, whether a file is one, and a new one.
class Printers : public Tool {
 public:
  void declare(Options& options) override {
    options.positional("action", action_, actions, "What to do", false);
    options.positional("printer", printer_,
                       "Name of a printer, or a profile file (.json), for show and check; the file "
                       "(.json) for new",
                       false);
    overwrite_.declare(options, "the profile");
    json_.declare(options);
  }

  void run() override {
    if (action_ != Action::create && overwrite_.overwrite)
      throw UsageError("--overwrite goes with printers new");
    if (action_ == Action::list) {
      if (!printer_.empty())
        throw UsageError("'" + printer_ + "' is not expected; printers show " + printer_ +
                         " describes it");
      return print(list());
    }
    if (printer_.empty()) throw UsageError("'printer' is missing; see --help");
    if (action_ == Action::create) return print(create());
    print(action_ == Action::show ? show(readPrinterProfile(printer_)) : check());
  }

 private:
  static void print(const std::string& text) { printData(text.c_str()); }

  [[nodiscard]] std::string list() const {
    ordered_json json = ordered_json::array();
    std::vector<std::array<std::string, 4>> rows;
    for (const std::string& name : installedPrinters()) {
      const PrinterProfile profile = readPrinterProfile(name);
      json.push_back(ordered_json::parse(toJson(profile)));
      rows.push_back(
          {printable(name), lengthsText(profile.pitch_mm), profile.technology, profile.title});
    }
    if (json_.json) return jsonText(json) + "\n";
    std::array<std::size_t, 4> widths{};
    for (const auto& row : rows) {
      for (std::size_t column = 0; column < row.size(); ++column)
        widths[column] = std::max(widths[column], row[column].size());
    }
    std::string text;
    for (const auto& row : rows) {
      for (std::size_t column = 0; column + 1 < row.size(); ++column)
        text += row[column] + std::string(widths[column] - row[column].size() + 2, ' ');
      text += row.back() + "\n";
    }
    return text;
  }

  [[nodiscard]] std::string show(const PrinterProfile& profile) const {
    return json_.json ? toJson(profile) + "\n" : describe(profile);
  }

  /// Writes a profile to fill in and returns what to do with it.
  [[nodiscard]] std::string create() const {
    const std::filesystem::path path = printer_;
    if (path.extension() != ".json")
      throw UsageError("'" + printer_ +
                       "' must end in .json; printers new NAME.json writes the "
                       "profile of a printer called NAME");
    if (const auto problem = fileNameProblem(path.stem().string()))
      throw UsageError("the name of the printer " + *problem);
    StagedOutput::check(path, StagedOutput::Kind::file, overwrite_.overwrite);
    StagedOutput staged(path, StagedOutput::Kind::file);
    const std::string profile = profileToFillIn(path.stem().string());
    writeFile(staged.path(), textBytes(profile), path);
    staged.commit();
    if (json_.json) return jsonText({{"profile", printer_}}) + "\n";
    const std::string file = printable(quotedForShell(printer_));
    std::string text = "wrote '" + printable(printer_) + "', whose figures are examples. Next:\n" +
                       "  replace them, and state where yours are from in \"source\"\n" +
                       "  vdbdither printers check " + file + "\n" + "  vdbdither printers show " +
                       file + "\n" + "  vdbdither mesh2sdf part.stl --printer " + file + " ! ...\n";
    if (const auto schema = findDataFile("printers/schema.json"))
      text += "All fields: " + printable(schema->string()) + "\n";
    return text;
  }

  [[nodiscard]] std::string check() const {
    const auto [problems, remarks] = printerProfileFindings(printer_);
    if (json_.json) {
      ordered_json json{{"profile", printer_}, {"problems", problems}};
      json["remarks"] = problems.empty() ? remarks : std::vector<std::string>();
      print(jsonText(json) + "\n");
    } else {
      for (const std::string& problem : problems) print(printable(problem) + "\n");
    }
    if (!problems.empty()) {
      throw DataError("'" + printer_ + "' has " + std::to_string(problems.size()) +
                      (problems.size() == 1 ? " problem" : " problems"));
    }
    if (json_.json) return "";
    std::string text = "'" + printable(printer_) + "' is a proper profile\n";
    for (const std::string& remark : remarks) text += printable(remark) + "\n";
    return text;
  }

  Action action_ = Action::list;
  std::string printer_;
  OverwriteOption overwrite_;
  JsonOption json_;
};

}  // namespace

extern const ToolInfo printers;
const ToolInfo printers{"printers", "Lists, shows, checks and writes printer profiles",
                        "printers show mimaki-3duj-553",
                        []() -> std::unique_ptr<Tool> { return std::make_unique<Printers>(); }};

}  // namespace vdbdither
