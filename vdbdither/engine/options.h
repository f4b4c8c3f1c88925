#pragma once

#include <algorithm>
#include <array>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <openvdb/Types.h>

#include "vdbdither/engine/option_values.h"

namespace vdbdither {

/// A word that an option accepts, and what it does.
struct Word {
  std::string name;
  std::string meaning;  ///< one sentence without a full stop
};

/// A value of an enum, the word that stands for it and what it does.
template <typename E>
struct Choice {
  E value;
  std::string_view name;
  std::string_view meaning;  ///< one sentence without a full stop
};

/// The word that stands for `value`, which is one of `choices`.
template <typename E, std::size_t n>
constexpr std::string_view nameOf(const std::array<Choice<E>, n>& choices, E value) {
  return std::find_if(choices.begin(), choices.end(),
                      [&](const Choice<E>& choice) { return choice.value == value; })
      ->name;
}

/// One option, declared once: parsing, --help, the history line, the manuals and the completion
/// come from it.
struct Option {
  enum class Kind { flag, value, positional };
  enum class Completion { none, file, printer };

  std::string name;  ///< kebab-case, without dashes
  char letter = 0;   ///< one-letter form, or 0
  Kind kind = Kind::value;
  std::string value;        ///< stands for a value that is none of `words`: LENGTH, FILE, N
  std::vector<Word> words;  ///< words that are accepted as a value
  Completion completion = Completion::none;  ///< of a value that is none of `words`
  std::string help;                          ///< one sentence without a full stop
  std::string range;                         ///< the accepted numbers, in words
  std::string fallback;                      ///< canonical text of the default
  bool required = false;
  /// A positional that takes every remaining word, or an option that may be given several times.
  bool repeated = false;
  bool sets_others = false;                       ///< a preset: read before all others
  std::string owner;                              ///< how the option that it belongs to is called
  std::function<bool()> applies;                  ///< whether that one is given; empty: always
  std::function<void(const std::string&)> set;    ///< throws UsageError that says what is accepted
  std::function<std::vector<std::string>()> get;  ///< canonical texts of the present values

  /// What stands for the value in help: `a|b|FILE`.
  [[nodiscard]] std::string valueText() const;
  /// How messages call it: `--name`, or the name of a positional.
  [[nodiscard]] std::string shown() const;
};

/// The options of one operator, bound to its members.
///
/// A target of type std::optional is empty until the option is given. `empty`, where it has a name,
/// is the word that stands for that state.
class Options {
 public:
  void flag(std::string name, bool& target, std::string help);
  void text(std::string name, std::string& target, std::string value, std::string help);
  /// A text that names a file.
  void file(std::string name, std::string& target, std::string value, std::string help);
  /// A text that may be given several times.
  void texts(std::string name, std::vector<std::string>& targets, std::string value,
             std::string help);
  void text(std::string name, std::optional<std::string>& target, std::string value,
            std::string help, const Word& empty);

  void integer(std::string name, int& target, Range range, std::string help);
  void integer(std::string name, std::optional<int>& target, Range range, std::string help,
               const Word& empty = {});
  void number(std::string name, double& target, Range range, std::string help);
  void number(std::string name, std::optional<double>& target, Range range, std::string help,
              const Word& empty = {});
  /// A length in mm; accepts units as parseLengthMm does.
  void length(std::string name, double& target_mm, Range range_mm, std::string help);
  void length(std::string name, std::optional<double>& target_mm, Range range_mm, std::string help,
              const Word& empty = {});
  /// Three numbers separated by commas, or one that stands for all three.
  void triple(std::string name, openvdb::Vec3d& target, std::string value, Range range,
              std::string help);
  /// The same of whole numbers.
  void triple(std::string name, openvdb::Coord& target, std::string value, Range range,
              std::string help);
  /// The same of lengths.
  void lengths(std::string name, openvdb::Vec3d& target_mm, std::string value, Range range_mm,
               std::string help);
  void lengths(std::string name, std::optional<openvdb::Vec3d>& target_mm, std::string value,
               Range range_mm, std::string help, const Word& empty = {});
  /// A value with a notation of its own. `set` throws UsageError; `get` returns the canonical text.
  void parsed(std::string name, std::string value, std::function<void(const std::string&)> set,
              std::function<std::string()> get, std::string help);

  /// One of `choices`.
  template <typename E, std::size_t n>
  void choice(const std::string& name, E& target, const std::array<Choice<E>, n>& choices,
              const std::string& help) {
    addChoice(name, Option::Kind::value, target, choices, help);
  }
  /// One of the words of a table that is known at run time only.
  void choice(std::string name, std::string& target, std::vector<Word> words, std::string help);
  /// One of `choices`, or another text, which names a file: `target` becomes `other` then.
  template <typename E, std::size_t n>
  void choiceOrFile(const std::string& name, E& target, const std::array<Choice<E>, n>& choices,
                    E other, std::string& path, std::string value, const std::string& help) {
    addChoice(name, Option::Kind::value, target, choices, help);
    Option& option = options_.back();
    const auto takeWord = option.set;
    const auto word = option.get;
    const std::vector<Word> words = option.words;
    option.value = std::move(value);
    option.completion = Option::Completion::file;
    option.set = [&target, &path, other, words, takeWord](const std::string& text) {
      if (std::any_of(words.begin(), words.end(),
                      [&](const Word& known) { return known.name == text; }))
        return takeWord(text);
      target = other;
      path = text;
    };
    option.get = [&target, &path, other, word] {
      return target == other ? std::vector<std::string>{path} : word();
    };
  }
  /// A choice that gives other options, declared after it, their defaults: `fill` is called with
  /// the default now, and with what the command line says before its other options are read,
  /// wherever this one stands.
  template <typename E, std::size_t n>
  void preset(const std::string& name, E& target, const std::array<Choice<E>, n>& choices,
              std::function<void(E)> fill, const std::string& help) {
    addChoice(name, Option::Kind::value, target, choices, help);
    Option& option = options_.back();
    option.sets_others = true;
    fill(target);
    option.set = [&target, take = option.set, fill = std::move(fill)](const std::string& text) {
      take(text);
      fill(target);
    };
  }

  void positional(std::string name, std::string& target, std::string help, bool required = true);
  template <typename E, std::size_t n>
  void positional(const std::string& name, E& target, const std::array<Choice<E>, n>& choices,
                  const std::string& help, bool required = true) {
    addChoice(name, Option::Kind::positional, target, choices, help);
    options_.back().required = required;
  }
  /// The one positional that takes several values.
  void positionals(std::string name, std::vector<std::string>& targets, std::string help);

  /// Gives the option declared last a one-letter form.
  void letter(char letter) { options_.back().letter = letter; }
  /// Makes the option declared last one that must be given.
  void required() {
    options_.back().required = true;
    options_.back().fallback.clear();
  }
  /// Makes `given` the name of one of the `count` options declared last, as messages call it, when
  /// it is given.
  void noteGiven(std::string& given, std::size_t count = 1);
  /// Makes the `count` options declared last part of another, called `owner`: where `applies()`
  /// does not hold, they have no value, and `parse` refuses them.
  void belongTo(const std::string& owner, const std::function<bool()>& applies,
                std::size_t count = 1);
  /// Leaves the `count` options declared last without a value, in the history line too, unless
  /// `applies()`.
  void onlyIf(const std::function<bool()>& applies, std::size_t count = 1);
  /// Says which words the text declared last accepts besides its value, and what they do.
  void words(std::vector<Word> words) { options_.back().words = std::move(words); }
  /// Says what completes a value of the option declared last.
  void completion(Option::Completion completion) { options_.back().completion = completion; }

  [[nodiscard]] std::span<const Option> all() const { return options_; }
  [[nodiscard]] const Option* find(std::string_view name) const;

  /// Reads `arguments` into the targets of these options and of `common`, which yield to an option
  /// of the same name. A value follows its option as the next word, or behind `=`; all words behind
  /// `--` are positionals. The last of several values counts. Throws UsageError; an unknown option
  /// names the nearest one.
  void parse(std::span<const std::string> arguments, const Options& common = {}) const;

  /// The arguments that lead to the present values, in order of declaration, quoted for a shell:
  /// every flag that is set and every option that has a value, be it a default or not.
  [[nodiscard]] std::string canonical() const;

 private:
  Option& add(std::string name, Option::Kind kind, std::string value, std::string help);
  /// Makes `option` accept one of `words`. `set` and `get` deal with its index.
  static void acceptWords(Option& option, std::vector<Word> words,
                          std::function<void(std::size_t)> set, std::function<std::size_t()> get);

  template <typename E, std::size_t n>
  void addChoice(const std::string& name, Option::Kind kind, E& target,
                 const std::array<Choice<E>, n>& choices, const std::string& help) {
    Option& option = add(name, kind, "", help);
    std::vector<Word> words;
    words.reserve(n);
    for (const Choice<E>& choice : choices)
      words.push_back({std::string(choice.name), std::string(choice.meaning)});
    acceptWords(
        option, std::move(words),
        [&target, choices](std::size_t index) { target = choices[index].value; },
        [&target, choices] {
          const auto found =
              std::find_if(choices.begin(), choices.end(),
                           [&](const Choice<E>& choice) { return choice.value == target; });
          return static_cast<std::size_t>(found - choices.begin());
        });
  }

  std::vector<Option> options_;
};

}  // namespace vdbdither
