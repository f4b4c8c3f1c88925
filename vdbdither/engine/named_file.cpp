#include "vdbdither/engine/named_file.h"

#include <algorithm>
#include <filesystem>
#include <limits>

#include "vdbdither/engine/run_options.h"
#include "vdbdither/model/errors.h"

namespace vdbdither {

namespace {

bool isVdb(const std::string& file) { return file.ends_with(".vdb"); }

/// Whether `word`, an option or several letters, takes the word behind it as its value.
bool takesNextWord(const std::string& word, const Options& own, const Options& common) {
  const auto takes_value = [&](const auto& matches) {
    for (const Options* options : {&own, &common}) {
      for (const Option& option : options->all()) {
        if (matches(option)) return option.kind == Option::Kind::value;
      }
    }
    return false;
  };
  if (word.starts_with("--"))
    return takes_value([&](const Option& option) { return word == "--" + option.name; });
  // `-qi a.vdb`: the first letter with a value takes what follows it.
  for (std::size_t at = 1; at < word.size(); ++at) {
    if (takes_value([&](const Option& option) { return option.letter == word[at]; }))
      return at + 1 == word.size();
  }
  return false;
}

/// The arguments that are neither options nor their values, by index.
std::vector<std::size_t> plainWords(std::span<const std::string> arguments, const Options& own,
                                    const Options& common) {
  std::vector<std::size_t> words;
  bool no_options = false;
  for (std::size_t i = 0; i < arguments.size(); ++i) {
    const std::string& word = arguments[i];
    if (no_options || !word.starts_with('-') || word == "-") {
      words.push_back(i);
    } else if (word == "--") {
      no_options = true;
    } else if (takesNextWord(word, own, common)) {
      ++i;
    }
  }
  return words;
}

/// The number of words that an operator takes for itself.
std::size_t ownWords(const Options& own) {
  std::size_t words = 0;
  for (const Option& option : own.all()) {
    if (option.kind != Option::Kind::positional) continue;
    if (option.repeated) return std::numeric_limits<std::size_t>::max();
    ++words;
  }
  return words;
}

}  // namespace

bool asksForHelp(std::span<const std::string> arguments) {
  return std::any_of(arguments.begin(), arguments.end(),
                     [](const std::string& word) { return word == "--help" || word == "-h"; });
}

std::string takeNamedFile(std::vector<std::string>& arguments, const OperatorInfo& info,
                          const Options& own, const Options& common) {
  const std::vector<std::size_t> words = plainWords(arguments, own, common);
  if (words.empty()) return "";
  std::string first = arguments[words.front()];
  if (words.size() <= ownWords(own)) {
    if (!isVdb(first) || info.names_vdb) return "";
  } else {
    // Any other word too many is refused when the arguments are read.
    std::error_code none;
    if (!isVdb(first) && first != "-" && !std::filesystem::exists(first, none)) return "";
  }
  arguments.erase(arguments.begin() + static_cast<std::ptrdiff_t>(words.front()));
  return first;
}

void refuseNamedFile(const OperatorInfo& info, const std::string& file, bool has_input) {
  const std::string name(info.name);
  if (info.on_file.make && !isVdb(file) && info.on_file.takes(file)) {
    throw UsageError(name + ": works on '" + file +
                     "' only if it is the whole command line, not in a chain");
  }
  if (has_input) {
    throw UsageError(name + ": takes the slabs of the stage before it and cannot read '" + file +
                     "' as well");
  }
}

bool worksOnFile(const OperatorInfo& info, std::span<const std::string> arguments) {
  if (!info.on_file.make || asksForHelp(arguments)) return false;
  const std::unique_ptr<Operator> made = info.make();
  Options own;
  made->declare(own);
  RunOptions run_options;
  Options common;
  run_options.declare(common);
  const std::vector<std::size_t> words = plainWords(arguments, own, common);
  return words.size() > ownWords(own) && info.on_file.takes(arguments[words.front()]);
}

}  // namespace vdbdither
