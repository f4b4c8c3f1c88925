#include "vdbdither/engine/options.h"

#include <cctype>
#include <cmath>
#include <type_traits>

#include "vdbdither/engine/comma_list.h"
#include "vdbdither/model/errors.h"
#include "vdbdither/model/words.h"

namespace vdbdither {

using openvdb::Coord;
using openvdb::Vec3d;

namespace {

using Texts = std::vector<std::string>;

/// How values of a kind are read and written.
template <typename T>
struct Notation {
  std::function<T(const std::string&)> parse;  ///< throws UsageError
  std::function<std::string(const T&)> text;
};

std::string withRange(const std::string& noun, const std::string& range) {
  return range.empty() ? noun : noun + " " + range;
}

UsageError refusal(const std::string& text, const std::string& wanted) {
  return UsageError("'" + text + "' is not accepted; the value must be " + wanted);
}

Notation<double> numbers(const Range& range) {
  return {[range, wanted = withRange("a number", range.text())](const std::string& text) {
            return parseNumber(text, range, wanted);
          },
          shortestText};
}

Notation<int> wholeNumbers(const Range& range) {
  return {[range, wanted = withRange("a whole number", range.text())](const std::string& text) {
            const double value = parseNumber(text, range, wanted);
            if (value != std::floor(value)) throw refusal(text, wanted);
            return static_cast<int>(value);
          },
          [](int value) { return std::to_string(value); }};
}

Notation<double> lengthsInMm(const Range& range_mm) {
  return {[range_mm](const std::string& text) { return parseLengthMm(text, range_mm); },
          [](double mm) { return shortestText(mm) + "mm"; }};
}

/// Three values of a kind that is called `noun`, separated by commas, or one for all three.
template <typename Vector>
Notation<Vector> triples(const Notation<typename Vector::ValueType>& one, const std::string& noun,
                         const std::string& range) {
  const std::string wanted =
      "one " + noun + " or three, separated by commas" + (range.empty() ? "" : ", each " + range);
  return {[one, wanted](const std::string& text) {
            const Texts words = commaList(text);
            if (words.size() != 1 && words.size() != 3) throw refusal(text, wanted);
            Vector values;
            try {
              for (int axis = 0; axis < 3; ++axis)
                values[axis] = one.parse(words[static_cast<std::size_t>(axis) % words.size()]);
            } catch (const UsageError&) {
              throw refusal(text, wanted);
            }
            return values;
          },
          [one](const Vector& v) {
            return one.text(v[0]) + "," + one.text(v[1]) + "," + one.text(v[2]);
          }};
}

/// The value of an option that is a plain text; an empty text is no value.
Texts valueOf(const std::string& text) { return text.empty() ? Texts{} : Texts{text}; }

std::string firstOf(const Texts& texts) { return texts.empty() ? "" : texts.front(); }

template <typename T>
void attach(Option& option, T& target, const Notation<T>& notation) {
  option.set = [&target, notation](const std::string& text) { target = notation.parse(text); };
  option.get = [&target, notation] { return Texts{notation.text(target)}; };
  option.fallback = firstOf(option.get());
}

template <typename T>
void attach(Option& option, std::optional<T>& target, const Notation<T>& notation,
            const Word& empty) {
  if (!empty.name.empty()) option.words = {empty};
  option.set = [&target, notation, empty](const std::string& text) {
    if (!empty.name.empty() && text == empty.name) {
      target.reset();
      return;
    }
    try {
      target = notation.parse(text);
    } catch (const UsageError& error) {
      throw empty.name.empty() ? error : UsageError(error.what() + (", or " + empty.name));
    }
  };
  option.get = [&target, notation, empty] {
    return target ? Texts{notation.text(*target)} : valueOf(empty.name);
  };
  option.fallback = firstOf(option.get());
}

/// A word of a command line that was found to belong to an option.
struct Given {
  const Option* option;
  std::string value;
};

/// Sorts the words of a command line by the options that they name.
class ArgumentReader {
 public:
  ArgumentReader(const Options& own, const Options& common) : common_(common) {
    for (const Option& option : own.all())
      (option.kind == Option::Kind::positional ? positionals_ : named_).push_back(&option);
    for (const Option& option : common.all()) {
      if (!own.find(option.name)) named_.push_back(&option);
    }
  }

  /// Throws UsageError.
  std::vector<Given> read(std::span<const std::string> words) {
    rest_ = words;
    bool options_ended = false;
    while (!rest_.empty()) {
      const std::string word = next();
      if (options_ended || !word.starts_with('-') || word == "-") {
        takePositional(word);
      } else if (word == "--") {
        options_ended = true;
      } else if (word.starts_with("--")) {
        takeName(word);
      } else {
        takeLetters(word);
      }
    }
    return std::move(given_);
  }

 private:
  std::string next() {
    std::string word = rest_.front();
    rest_ = rest_.subspan(1);
    return word;
  }

  [[nodiscard]] const Option* byName(const std::string& name) const {
    const auto found = std::find_if(named_.begin(), named_.end(),
                                    [&](const Option* option) { return option->name == name; });
    return found == named_.end() ? nullptr : *found;
  }

  [[nodiscard]] const Option* byLetter(char letter) const {
    const auto found = std::find_if(named_.begin(), named_.end(),
                                    [&](const Option* option) { return option->letter == letter; });
    return found == named_.end() ? nullptr : *found;
  }

  [[nodiscard]] bool isOption(const std::string& word) const {
    if (word.starts_with("--")) return byName(word.substr(2, word.find('=') - 2));
    return word.size() == 2 && word.front() == '-' && byLetter(word.back());
  }

  void takeValue(const Option& option) {
    if (rest_.empty() || isOption(rest_.front())) {
      const std::string call = option.shown() + " " + option.valueText();
      throw UsageError(option.shown() + ": the value is missing; give " + call);
    }
    given_.push_back({&option, next()});
  }

  void takeName(const std::string& word) {
    const std::size_t equals = word.find('=');
    const Option* option = byName(word.substr(2, equals - 2));
    if (!option) refuseUnknown(word.substr(0, equals));
    const bool is_flag = option->kind == Option::Kind::flag;
    if (equals != std::string::npos) {
      if (is_flag) throw UsageError(option->shown() + ": takes no value; leave '=' out");
      given_.push_back({option, word.substr(equals + 1)});
    } else if (is_flag) {
      given_.push_back({option, "true"});
    } else {
      takeValue(*option);
    }
  }

  void takeLetters(const std::string& word) {
    for (std::size_t at = 1; at < word.size(); ++at) {
      const Option* option = byLetter(word[at]);
      if (!option) refuseUnknown(word);
      if (option->kind == Option::Kind::flag) {
        given_.push_back({option, "true"});
      } else if (at + 1 < word.size()) {
        given_.push_back({option, word.substr(at + 1)});
        return;
      } else {
        takeValue(*option);
      }
    }
  }

  void takePositional(const std::string& word) {
    if (taken_positionals_ == positionals_.size()) {
      const bool is_volume = word.ends_with(".vdb") && common_.find("input");
      throw UsageError(
          "'" + word + "' is not expected; " +
          (is_volume ? "-i " + word + " reads it, -o " + word + " writes it" : "see --help"));
    }
    const Option* option = positionals_[taken_positionals_];
    if (!option->repeated) ++taken_positionals_;
    given_.push_back({option, word});
  }

  [[noreturn]] void refuseUnknown(const std::string& word) const {
    Texts names;
    for (const Option* option : named_) names.push_back(option->shown());
    const std::string near = nearestWord(word, names);
    throw UsageError("'" + word + "' is not an option; " +
                     (near.empty() ? "see --help" : "did you mean '" + near + "'?"));
  }

  const Options& common_;
  std::vector<const Option*> positionals_;
  std::vector<const Option*> named_;
  std::size_t taken_positionals_ = 0;
  std::span<const std::string> rest_;
  std::vector<Given> given_;
};

void take(const Given& given) {
  try {
    given.option->set(given.value);
  } catch (const UsageError& error) {
    throw UsageError(given.option->shown() + ": " + error.what());
  }
}

}  // namespace

std::string Option::valueText() const {
  std::string text;
  for (const Word& word : words) text += (text.empty() ? "" : "|") + word.name;
  return text + (text.empty() || value.empty() ? "" : "|") + value;
}

std::string Option::shown() const { return (kind == Kind::positional ? "" : "--") + name; }

Option& Options::add(std::string name, Option::Kind kind, std::string value, std::string help) {
  Option& option = options_.emplace_back();
  option.name = std::move(name);
  option.kind = kind;
  option.value = std::move(value);
  option.help = std::move(help);
  return option;
}

void Options::flag(std::string name, bool& target, std::string help) {
  Option& option = add(std::move(name), Option::Kind::flag, "", std::move(help));
  option.set = [&target](const std::string&) { target = true; };
  option.get = [&target] { return target ? Texts{"true"} : Texts{}; };
}

void Options::text(std::string name, std::string& target, std::string value, std::string help) {
  Option& option = add(std::move(name), Option::Kind::value, std::move(value), std::move(help));
  option.fallback = target;
  option.set = [&target](const std::string& text) { target = text; };
  // An empty text is a value only where it takes the place of another.
  option.get = [&target, fallback = target] {
    return fallback.empty() ? valueOf(target) : Texts{target};
  };
}

void Options::file(std::string name, std::string& target, std::string value, std::string help) {
  text(std::move(name), target, std::move(value), std::move(help));
  completion(Option::Completion::file);
}

void Options::texts(std::string name, Texts& targets, std::string value, std::string help) {
  Option& option = add(std::move(name), Option::Kind::value, std::move(value), std::move(help));
  option.repeated = true;
  option.set = [&targets](const std::string& text) { targets.push_back(text); };
  option.get = [&targets] { return targets; };
}

void Options::text(std::string name, std::optional<std::string>& target, std::string value,
                   std::string help, const Word& empty) {
  const auto same = [](const std::string& text) { return text; };
  attach(add(std::move(name), Option::Kind::value, std::move(value), std::move(help)), target,
         {same, same}, empty);
}

void Options::integer(std::string name, int& target, Range range, std::string help) {
  Option& option = add(std::move(name), Option::Kind::value, "N", std::move(help));
  option.range = range.text();
  attach(option, target, wholeNumbers(range));
}

void Options::integer(std::string name, std::optional<int>& target, Range range, std::string help,
                      const Word& empty) {
  Option& option = add(std::move(name), Option::Kind::value, "N", std::move(help));
  option.range = range.text();
  attach(option, target, wholeNumbers(range), empty);
}

void Options::number(std::string name, double& target, Range range, std::string help) {
  Option& option = add(std::move(name), Option::Kind::value, "X", std::move(help));
  option.range = range.text();
  attach(option, target, numbers(range));
}

void Options::number(std::string name, std::optional<double>& target, Range range, std::string help,
                     const Word& empty) {
  Option& option = add(std::move(name), Option::Kind::value, "X", std::move(help));
  option.range = range.text();
  attach(option, target, numbers(range), empty);
}

void Options::length(std::string name, double& target_mm, Range range_mm, std::string help) {
  Option& option = add(std::move(name), Option::Kind::value, "LENGTH", std::move(help));
  option.range = range_mm.text("mm");
  attach(option, target_mm, lengthsInMm(range_mm));
}

void Options::length(std::string name, std::optional<double>& target_mm, Range range_mm,
                     std::string help, const Word& empty) {
  Option& option = add(std::move(name), Option::Kind::value, "LENGTH", std::move(help));
  option.range = range_mm.text("mm");
  attach(option, target_mm, lengthsInMm(range_mm), empty);
}

void Options::triple(std::string name, Vec3d& target, std::string value, Range range,
                     std::string help) {
  Option& option = add(std::move(name), Option::Kind::value, std::move(value), std::move(help));
  option.range = range.text();
  attach(option, target, triples<Vec3d>(numbers(range), "number", range.text()));
}

void Options::triple(std::string name, Coord& target, std::string value, Range range,
                     std::string help) {
  Option& option = add(std::move(name), Option::Kind::value, std::move(value), std::move(help));
  option.range = range.text();
  attach(option, target, triples<Coord>(wholeNumbers(range), "whole number", range.text()));
}

void Options::lengths(std::string name, Vec3d& target_mm, std::string value, Range range_mm,
                      std::string help) {
  Option& option = add(std::move(name), Option::Kind::value, std::move(value), std::move(help));
  option.range = range_mm.text("mm");
  attach(option, target_mm, triples<Vec3d>(lengthsInMm(range_mm), "length", range_mm.text("mm")));
}

void Options::lengths(std::string name, std::optional<Vec3d>& target_mm, std::string value,
                      Range range_mm, std::string help, const Word& empty) {
  Option& option = add(std::move(name), Option::Kind::value, std::move(value), std::move(help));
  option.range = range_mm.text("mm");
  attach(option, target_mm, triples<Vec3d>(lengthsInMm(range_mm), "length", range_mm.text("mm")),
         empty);
}

void Options::parsed(std::string name, std::string value,
                     std::function<void(const std::string&)> set, std::function<std::string()> get,
                     std::string help) {
  Option& option = add(std::move(name), Option::Kind::value, std::move(value), std::move(help));
  option.fallback = get();
  option.set = std::move(set);
  option.get = [get = std::move(get)] { return valueOf(get()); };
}

void Options::choice(std::string name, std::string& target, std::vector<Word> words,
                     std::string help) {
  const auto indexOf = [&target, words] {
    const auto found = std::find_if(words.begin(), words.end(),
                                    [&](const Word& word) { return word.name == target; });
    return static_cast<std::size_t>(found - words.begin());
  };
  const auto take = [&target, words](std::size_t index) { target = words[index].name; };
  acceptWords(add(std::move(name), Option::Kind::value, "", std::move(help)), std::move(words),
              take, indexOf);
}

void Options::acceptWords(Option& option, std::vector<Word> words,
                          std::function<void(std::size_t)> set, std::function<std::size_t()> get) {
  option.words = words;
  option.set = [words, set = std::move(set)](const std::string& text) {
    for (std::size_t index = 0; index < words.size(); ++index) {
      if (words[index].name == text) return set(index);
    }
    Texts names;
    for (const Word& word : words) names.push_back(word.name);
    throw UsageError("'" + text + "' is not accepted; choose " + alternatives(names));
  };
  option.get = [words = std::move(words), get = std::move(get)] {
    const std::size_t index = get();
    return index < words.size() ? Texts{words[index].name} : Texts{};
  };
  option.fallback = firstOf(option.get());
}

void Options::positional(std::string name, std::string& target, std::string help, bool required) {
  Option& option = add(std::move(name), Option::Kind::positional, "", std::move(help));
  option.required = required;
  option.completion = Option::Completion::file;
  option.fallback = target;
  option.set = [&target](const std::string& text) { target = text; };
  option.get = [&target] { return valueOf(target); };
}

void Options::positionals(std::string name, Texts& targets, std::string help) {
  Option& option = add(std::move(name), Option::Kind::positional, "", std::move(help));
  option.required = true;
  option.repeated = true;
  option.completion = Option::Completion::file;
  option.set = [&targets](const std::string& text) { targets.push_back(text); };
  option.get = [&targets] { return targets; };
}

const Option* Options::find(std::string_view name) const {
  const auto found = std::find_if(options_.begin(), options_.end(),
                                  [&](const Option& o) { return o.name == name; });
  return found == options_.end() ? nullptr : &*found;
}

void Options::parse(std::span<const std::string> arguments, const Options& common) const {
  std::vector<Given> all = ArgumentReader(*this, common).read(arguments);
  std::stable_partition(all.begin(), all.end(),
                        [](const Given& given) { return given.option->sets_others; });
  for (const Given& given : all) {
    // Of a shell variable that is not set, most likely.
    if (given.option->completion == Option::Completion::file && given.value.empty())
      throw UsageError(given.option->shown() + ": the name is empty");
    take(given);
  }
  for (const Given& given : all) {
    const Option& option = *given.option;
    if (option.applies && !option.applies())
      throw UsageError(option.shown() + ": belongs to " + option.owner +
                       "; leave it out, or give that too");
  }
  for (const Option& option : options_) {
    const bool is_given = std::any_of(all.begin(), all.end(), [&](const Given& given) {
      return given.option == &option && !given.value.empty();
    });
    if (option.required && !is_given)
      throw UsageError("'" + option.shown() + "' is missing; see --help");
  }
}

void Options::noteGiven(std::string& given, std::size_t count) {
  for (Option& option : std::span(options_).last(count)) {
    option.set = [&given, shown = option.shown(),
                  set = std::move(option.set)](const std::string& text) {
      set(text);
      given = shown;
    };
  }
}

void Options::belongTo(const std::string& owner, const std::function<bool()>& applies,
                       std::size_t count) {
  onlyIf(applies, count);
  for (Option& option : std::span(options_).last(count)) {
    option.owner = owner;
    option.applies = applies;
  }
}

void Options::onlyIf(const std::function<bool()>& applies, std::size_t count) {
  for (Option& option : std::span(options_).last(count)) {
    option.get = [applies, get = std::move(option.get)] { return applies() ? get() : Texts{}; };
  }
}

std::string Options::canonical() const {
  Texts words;
  Texts last;  // positionals that look like options, and those behind them
  const auto isDashed = [](const std::string& word) { return word.size() > 1 && word[0] == '-'; };
  const auto isNegative = [&](const std::string& word) {
    return isDashed(word) && std::isdigit(static_cast<unsigned char>(word[1])) != 0;
  };
  for (const Option& option : options_) {
    for (const std::string& value : option.get()) {
      if (option.kind == Option::Kind::positional) {
        const bool apart = !last.empty() || isDashed(value);
        (apart ? last : words).push_back(quotedForShell(value));
        continue;
      }
      words.push_back(option.shown());
      if (option.kind == Option::Kind::flag) continue;
      if (isDashed(value) && !isNegative(value)) {
        words.back().append("=").append(quotedForShell(value));
      } else {
        words.push_back(quotedForShell(value));
      }
    }
  }
  if (!last.empty()) words.emplace_back("--");
  words.insert(words.end(), last.begin(), last.end());
  std::string text;
  for (const std::string& word : words) text.append(text.empty() ? "" : " ").append(word);
  return text;
}

}  // namespace vdbdither
