#include <algorithm>
#include <array>
#include <cmath>
#include <sstream>

#include <nlohmann/json.hpp>

#include "io/file/standard_streams.h"
#include "io/profile/printer_profile.h"
#include "vdbdither/engine/json_text.h"
#include "vdbdither/engine/option_groups.h"
#include "vdbdither/engine/tool.h"
#include "vdbdither/model/errors.h"
#include "vdbdither/model/printable.h"

namespace vdbdither {

namespace {

using nlohmann::ordered_json;

enum class Action { list, show, check };
constexpr std::array<Choice<Action>, 3> actions{
    {{Action::list, "list", "Lists the installed printers"},
     {Action::show, "show", "Describes a printer"},
     {Action::check, "check", "Lists the problems of a profile"}}};

std::string lengthsText(const openvdb::Vec3d& mm) {
  // To the nanometre.
  const auto text = [](double length) { return shortestText(std::round(length * 1e6) / 1e6); };
  return text(mm[0]) + " x " + text(mm[1]) + " x " + text(mm[2]) + " mm";
}

/// The profiles there are, one of them, or whether a file is one.
class Printers : public Tool {
 public:
  void declare(Options& options) override {
    options.positional("action", action_, actions, "What to do", false);
    options.positional("printer", printer_,
                       "Name of a printer, or a profile file (.json), for show and check", false);
    json_.declare(options);
  }

  void run() override {
    if (action_ == Action::list) {
      if (!printer_.empty())
        throw UsageError("'" + printer_ + "' is not expected; printers show " + printer_ +
                         " describes it");
      return print(list());
    }
    if (printer_.empty()) throw UsageError("'printer' is missing; see --help");
    print(action_ == Action::show ? show(readPrinterProfile(printer_)) : check());
  }

 private:
  static void print(const std::string& text) { printData(text.c_str()); }

  [[nodiscard]] std::string list() const {
    ordered_json json = ordered_json::array();
    std::ostringstream text;
    for (const std::string& name : installedPrinters()) {
      const PrinterProfile profile = readPrinterProfile(name);
      json.push_back(ordered_json::parse(toJson(profile)));
      text << printable(name)
           << std::string(std::max<std::size_t>(24, name.size() + 1) - name.size(), ' ')
           << lengthsText(profile.pitch_mm) << "  " << profile.title << "\n";
    }
    return json_.json ? jsonText(json) + "\n" : text.str();
  }

  [[nodiscard]] std::string show(const PrinterProfile& profile) const {
    if (json_.json) return toJson(profile) + "\n";
    std::ostringstream text;
    text << "name      " << profile.name << "\ntitle     " << profile.title << "\npitch     "
         << lengthsText(profile.pitch_mm) << "\n";
    if (profile.build_mm != openvdb::Vec3d(0.0))
      text << "build     " << lengthsText(profile.build_mm) << "\n";
    const char* head = "materials ";
    for (const Material& material : profile.materials) {
      text << head << material.name;
      for (std::size_t channel = 0; channel < 4; ++channel)
        text << (channel == 0 ? " " : ",") << int{material.rgba[channel]};
      text << "\n";
      head = "          ";
    }
    if (!profile.source.empty()) text << "source    " << profile.source << "\n";
    return text.str();
  }

  [[nodiscard]] std::string check() const {
    const std::vector<std::string> problems = printerProfileProblems(printer_);
    if (json_.json) {
      print(jsonText({{"profile", printer_}, {"problems", problems}}) + "\n");
    } else {
      for (const std::string& problem : problems) print(printable(problem) + "\n");
    }
    if (!problems.empty()) {
      throw DataError("'" + printer_ + "' has " + std::to_string(problems.size()) +
                      (problems.size() == 1 ? " problem" : " problems"));
    }
    return json_.json ? "" : "'" + printable(printer_) + "' is a proper profile\n";
  }

  Action action_ = Action::list;
  std::string printer_;
  JsonOption json_;
};

}  // namespace

extern const ToolInfo printers;
const ToolInfo printers{"printers", "Lists, shows and checks printer profiles",
                        "printers show mimaki-3duj-553",
                        []() -> std::unique_ptr<Tool> { return std::make_unique<Printers>(); }};

}  // namespace vdbdither
