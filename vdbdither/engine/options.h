#pragma once

#include <functional>
#include <limits>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <openvdb/Types.h>

namespace vdbdither {

/// One option, declared once: parsing, --help, the history line and the generated pages come from
/// it.
struct Option {
  enum class Kind { flag, value, positional };

  std::string name;  ///< kebab-case, without dashes
  char letter = 0;   ///< one-letter form, or 0
  Kind kind = Kind::value;
  std::string value;     ///< what stands for the value in help: MM, FILE, N, blue|white|none
  std::string help;      ///< one sentence
  std::string fallback;  ///< canonical text of the default
  bool required = false;
  /// A positional that takes every remaining word, or an option that may be given several times.
  bool repeated = false;
  std::function<void(const std::string&)>
      set;                           ///< throws UsageError with what would have been accepted
  std::function<std::string()> get;  ///< canonical text of the present value
};

/// The options of one operator, bound to its members.
class Options {
 public:
  void flag(std::string name, bool& target, std::string help);
  void text(std::string name, std::string& target, std::string value, std::string help);
  /// An option that may be given again and again.
  void texts(std::string name, std::vector<std::string>& targets, std::string value,
             std::string help);
  void choice(std::string name, std::string& target, std::vector<std::string> choices,
              std::string help);
  void integer(std::string name, int& target, int min, int max, std::string help);
  void number(std::string name, double& target, double min, double max, std::string help);
  /// A length in mm; accepts units as parseLengthMm does.
  void length(std::string name, double& target_mm, std::string help);
  /// Three numbers separated by commas, or one that stands for all three.
  void triple(std::string name, openvdb::Vec3d& target, std::string value, std::string help);
  void positional(std::string name, std::string& target, std::string help, bool required = true);
  /// The one positional that takes several values.
  void positionals(std::string name, std::vector<std::string>& targets, std::string help);
  /// Gives the option declared last a one-letter form.
  void letter(char letter) { options_.back().letter = letter; }

  [[nodiscard]] std::span<const Option> all() const { return options_; }
  [[nodiscard]] const Option* find(std::string_view name) const;

  /// Reads `arguments` into the targets of these options and of `common`, which yield to an option
  /// of the same name. Throws UsageError; an unknown option names the nearest one.
  void parse(std::span<const std::string> arguments, const Options& common = {}) const;

  /// The text of --help: usage, the options with their defaults, the common ones in a group of
  /// their own, the lines of the example.
  [[nodiscard]] std::string help(const std::string& verb, const std::string& summary,
                                 const std::string& example, const Options& common) const;

  /// The arguments that lead to the present values, in order of declaration, defaults left out,
  /// quoted for a shell.
  [[nodiscard]] std::string canonical() const;

 private:
  Option& add(std::string name, Option::Kind kind, std::string value, std::string help);

  std::vector<Option> options_;
};

/// Reads `0.042mm`, `42um`, `600dpi` (25.4/600), `1.5in`, `2cm`, or a plain number of mm. Throws
/// UsageError.
double parseLengthMm(std::string_view text);

/// The shortest text that reads back as the same double.
std::string shortestText(double value);

/// The candidate nearest to `word` by edit distance, or an empty text where none is near.
std::string nearestWord(std::string_view word, std::span<const std::string> candidates);

}  // namespace vdbdither
