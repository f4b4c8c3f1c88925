#include "vdbdither/engine/options.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <memory>
#include <numeric>

#include <CLI/CLI.hpp>

#include "vdbdither/engine/comma_list.h"
#include "vdbdither/model/errors.h"

namespace vdbdither {

namespace {

/// The whole of `text` as a finite number; throws UsageError saying that `wanted` was expected.
double parseNumber(std::string_view text, const std::string& wanted) {
  const std::string_view digits = text.starts_with('+') ? text.substr(1) : text;
  double value = 0;
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
  if (error != std::errc() || end != digits.data() + digits.size() || !std::isfinite(value)) {
    throw UsageError("'" + std::string(text) + "' is not " + wanted);
  }
  return value;
}

std::string joined(std::span<const std::string> words, const char* separator) {
  std::string text;
  for (const std::string& word : words) text += (text.empty() ? "" : separator) + word;
  return text;
}

std::string quotedForShell(const std::string& word) {
  const auto plain = [](char c) {
    return std::isalnum(static_cast<unsigned char>(c)) || std::strchr("_-+=./,:@%", c);
  };
  if (!word.empty() && std::all_of(word.begin(), word.end(), plain)) return word;
  std::string text = "'";
  for (const char c : word) text += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return text + "'";
}

std::size_t editDistance(std::string_view a, std::string_view b) {
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), 0);
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::size_t diagonal = std::exchange(row[0], i);
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t replaced = diagonal + (a[i - 1] != b[j - 1]);
      diagonal = std::exchange(row[j], std::min({row[j] + 1, row[j - 1] + 1, replaced}));
    }
  }
  return row.back();
}

std::string range(double min, double max) {
  return std::isinf(max) ? "at least " + shortestText(min)
                         : "between " + shortestText(min) + " and " + shortestText(max);
}

std::string cliName(const Option& option) {
  if (option.kind == Option::Kind::positional) return option.name;
  const std::string dashed = "--" + option.name;
  return option.letter ? std::string("-") + option.letter + "," + dashed : dashed;
}

void addTo(CLI::App& app, const Option& option, const std::string& group) {
  const auto set = [&option](const std::string& text) {
    try {
      option.set(text);
    } catch (const UsageError& error) {
      const std::string shown =
          option.kind == Option::Kind::positional ? option.name : "--" + option.name;
      throw UsageError(shown + ": " + error.what());
    }
  };
  CLI::Option* added = nullptr;
  if (option.kind == Option::Kind::flag) {
    added = app.add_flag_callback(
        cliName(option), [set] { set("true"); }, option.help);
  } else if (option.repeated) {
    added = app.add_option_function<std::vector<std::string>>(
        cliName(option),
        [set](const std::vector<std::string>& texts) {
          for (const std::string& text : texts) set(text);
        },
        option.help);
  } else {
    added = app.add_option_function<std::string>(cliName(option), set, option.help);
  }
  added->group(group)->option_text(option.value +
                                   (option.fallback.empty() ? "" : " [" + option.fallback + "]"));
  if (option.kind == Option::Kind::value && option.repeated) {
    added->allow_extra_args(false);
  } else if (option.kind == Option::Kind::value) {
    added->multi_option_policy(CLI::MultiOptionPolicy::TakeLast);
  }
}

}  // namespace

double parseLengthMm(std::string_view text) {
  constexpr std::array<std::pair<std::string_view, double>, 7> units{{{"mm", 1.0},
                                                                      {"um", 1e-3},
                                                                      {"µm", 1e-3},
                                                                      {"nm", 1e-6},
                                                                      {"cm", 10.0},
                                                                      {"in", 25.4},
                                                                      {"m", 1000.0}}};
  const std::string wanted = "a length such as 0.042mm, 42um or 600dpi";
  if (text.ends_with("dpi")) {
    const double dots = parseNumber(text.substr(0, text.size() - 3), wanted);
    if (dots <= 0) throw UsageError("'" + std::string(text) + "' is not " + wanted);
    return 25.4 / dots;
  }
  for (const auto& [unit, factor] : units) {
    if (!text.ends_with(unit)) continue;
    const double number = parseNumber(text.substr(0, text.size() - unit.size()), wanted);
    // Dividing by a whole number rounds once: 42um is the double nearest to 0.042, as 0.042mm is.
    return factor < 1 ? number / std::round(1 / factor) : number * factor;
  }
  return parseNumber(text, wanted);
}

std::string shortestText(double value) {
  std::array<char, 40> buffer{};
  const auto result = std::to_chars(buffer.data(), buffer.data() + buffer.size(), value);
  return {buffer.data(), result.ptr};
}

std::string nearestWord(std::string_view word, std::span<const std::string> candidates) {
  std::string best;
  std::size_t best_distance = std::max<std::size_t>(2, word.size() / 3) + 1;
  for (const std::string& candidate : candidates) {
    const std::size_t distance = editDistance(word, candidate);
    if (distance < best_distance) {
      best_distance = distance;
      best = candidate;
    }
  }
  return best;
}

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
  option.set = [&target](const std::string& text) { target = text == "true"; };
  option.get = [&target] { return target ? "true" : ""; };
}

void Options::text(std::string name, std::string& target, std::string value, std::string help) {
  Option& option = add(std::move(name), Option::Kind::value, std::move(value), std::move(help));
  option.fallback = target;
  option.set = [&target](const std::string& text) { target = text; };
  option.get = [&target] { return target; };
}

void Options::texts(std::string name, std::vector<std::string>& targets, std::string value,
                    std::string help) {
  Option& option = add(std::move(name), Option::Kind::value, std::move(value), std::move(help));
  option.repeated = true;
  option.set = [&targets](const std::string& text) { targets.push_back(text); };
  option.get = [&targets, option_name = option.name] {
    std::vector<std::string> quoted;
    std::transform(targets.begin(), targets.end(), std::back_inserter(quoted), quotedForShell);
    const std::string between = " --" + option_name + " ";
    return joined(quoted, between.c_str());
  };
}

void Options::choice(std::string name, std::string& target, std::vector<std::string> choices,
                     std::string help) {
  text(std::move(name), target, joined(choices, "|"), std::move(help));
  options_.back().set = [&target, choices = std::move(choices)](const std::string& text) {
    if (std::find(choices.begin(), choices.end(), text) == choices.end()) {
      throw UsageError("'" + text + "' is none of " + joined(choices, ", "));
    }
    target = text;
  };
}

void Options::integer(std::string name, int& target, int min, int max, std::string help) {
  Option& option = add(std::move(name), Option::Kind::value, "N", std::move(help));
  option.get = [&target] { return std::to_string(target); };
  option.fallback = option.get();
  option.set = [&target, min, max](const std::string& text) {
    const bool bounded = max != std::numeric_limits<int>::max();
    const std::string wanted =
        "a whole number " + range(min, bounded ? max : std::numeric_limits<double>::infinity());
    const double value = parseNumber(text, wanted);
    if (value != std::floor(value) || value < min || value > max) {
      throw UsageError("'" + text + "' is not " + wanted);
    }
    target = static_cast<int>(value);
  };
}

void Options::number(std::string name, double& target, double min, double max, std::string help) {
  Option& option = add(std::move(name), Option::Kind::value, "X", std::move(help));
  option.get = [&target] { return shortestText(target); };
  option.fallback = option.get();
  option.set = [&target, min, max](const std::string& text) {
    const std::string wanted = "a number " + range(min, max);
    const double value = parseNumber(text, wanted);
    if (value < min || value > max) throw UsageError("'" + text + "' is not " + wanted);
    target = value;
  };
}

void Options::length(std::string name, double& target_mm, std::string help) {
  Option& option = add(std::move(name), Option::Kind::value, "LENGTH", std::move(help));
  option.get = [&target_mm] {
    return target_mm == 0 ? std::string() : shortestText(target_mm) + "mm";
  };
  option.fallback = option.get();
  option.set = [&target_mm](const std::string& text) { target_mm = parseLengthMm(text); };
}

void Options::triple(std::string name, openvdb::Vec3d& target, std::string value,
                     std::string help) {
  Option& option = add(std::move(name), Option::Kind::value, std::move(value), std::move(help));
  option.get = [&target] {
    return shortestText(target[0]) + "," + shortestText(target[1]) + "," + shortestText(target[2]);
  };
  option.fallback = option.get();
  option.set = [&target](const std::string& text) {
    const std::string wanted = "three numbers such as 0,45,90, or one for all three";
    const std::vector<std::string> numbers = commaList(text);
    if (numbers.size() != 1 && numbers.size() != 3)
      throw UsageError("'" + text + "' is not " + wanted);
    for (std::size_t axis = 0; axis < 3; ++axis)
      target[static_cast<int>(axis)] = parseNumber(numbers[axis % numbers.size()], wanted);
  };
}

void Options::positional(std::string name, std::string& target, std::string help, bool required) {
  Option& option = add(std::move(name), Option::Kind::positional, "", std::move(help));
  option.required = required;
  option.fallback = target;
  option.set = [&target](const std::string& text) { target = text; };
  option.get = [&target] { return target; };
}

void Options::positionals(std::string name, std::vector<std::string>& targets, std::string help) {
  Option& option = add(std::move(name), Option::Kind::positional, "", std::move(help));
  option.required = true;
  option.repeated = true;
  option.set = [&targets](const std::string& text) { targets.push_back(text); };
  option.get = [&targets] {
    std::vector<std::string> quoted;
    std::transform(targets.begin(), targets.end(), std::back_inserter(quoted), quotedForShell);
    return joined(quoted, " ");
  };
}

const Option* Options::find(std::string_view name) const {
  const auto found = std::find_if(options_.begin(), options_.end(),
                                  [&](const Option& o) { return o.name == name; });
  return found == options_.end() ? nullptr : &*found;
}

void Options::parse(std::span<const std::string> arguments, const Options& common) const {
  CLI::App app;
  app.set_help_flag();
  app.allow_extras();
  std::vector<std::string> names;
  const auto take = [&](const Option& option) {
    addTo(app, option, "");
    if (option.kind != Option::Kind::positional) names.push_back("--" + option.name);
  };
  for (const Option& option : options_) take(option);
  for (const Option& option : common.options_) {
    if (!find(option.name)) take(option);
  }
  try {
    app.parse(std::vector<std::string>(arguments.rbegin(), arguments.rend()));
  } catch (const CLI::ParseError& error) {
    throw UsageError(error.what());
  }
  const std::vector<std::string> extras = app.remaining();
  if (extras.empty()) {
    for (const Option& option : options_) {
      if (option.required && option.get().empty())
        throw UsageError("no " + option.name + " is given; see --help");
    }
    return;
  }
  const std::string& extra = extras.front();
  if (!extra.starts_with('-')) {
    throw UsageError("unexpected argument '" + extra + "'; " +
                     (extra.ends_with(".vdb") && common.find("input")
                          ? "-i " + extra + " reads it, -o " + extra + " writes it"
                          : "see --help"));
  }
  const std::string option_name = extra.substr(0, extra.find('='));
  const std::string near = nearestWord(option_name, names);
  throw UsageError("no option '" + option_name + "'; " +
                   (near.empty() ? "see --help" : "did you mean '" + near + "'?"));
}

std::string Options::help(const std::string& verb, const std::string& summary,
                          const std::string& example, const Options& common) const {
  CLI::App app(summary, "vdbdither " + verb);
  app.set_help_flag();
  for (const Option& option : options_) addTo(app, option, "Options");
  for (const Option& option : common.options_) {
    if (!find(option.name)) addTo(app, option, "Options of every operator");
  }
  if (!example.empty()) {
    std::string footer = "Example:\n  vdbdither ";
    for (const char c : example)
      footer += c == '\n' ? std::string("\n  vdbdither ") : std::string(1, c);
    app.footer(footer);
  }
  app.get_formatter()->column_width(34);
  return app.help();
}

std::string Options::canonical() const {
  std::string text;
  for (const Option& option : options_) {
    const std::string value = option.get();
    if (value == option.fallback) continue;
    if (option.kind != Option::Kind::positional) text += " --" + option.name;
    if (option.kind != Option::Kind::flag)
      text += " " + (option.repeated ? value : quotedForShell(value));
  }
  return text.empty() ? text : text.substr(1);
}

}  // namespace vdbdither
