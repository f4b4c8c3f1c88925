#include "vdbdither/engine/chain.h"

#include <cctype>

#include "vdbdither/model/errors.h"

namespace vdbdither {

std::vector<Step> parseChain(std::span<const std::string> words) {
  std::vector<Step> steps(1);
  for (const std::string& word : words) {
    if (word == "!" || word == "|") {
      if (steps.back().verb.empty()) throw UsageError("there is no operator before '" + word + "'");
      steps.emplace_back();
    } else if (steps.back().verb.empty()) {
      steps.back().verb = word;
    } else {
      steps.back().arguments.push_back(word);
    }
  }
  if (steps.back().verb.empty()) {
    throw UsageError(steps.size() == 1 ? "the chain is empty"
                                       : "there is no operator after the last '!' or '|'");
  }
  return steps;
}

std::vector<std::string> splitWords(const std::string& line) {
  std::vector<std::string> words;
  std::string word;
  bool in_word = false;
  char quote = 0;
  const auto finish = [&] {
    if (in_word) words.push_back(word);
    word.clear();
    in_word = false;
  };
  for (std::size_t at = 0; at < line.size(); ++at) {
    const char c = line[at];
    if (quote) {
      if (c == quote) {
        quote = 0;
      } else {
        word += c == '\\' && quote == '"' && at + 1 < line.size() ? line[++at] : c;
      }
    } else if (c == '\'' || c == '"') {
      quote = c;
      in_word = true;
    } else if (c == '\\' && at + 1 < line.size()) {
      word += line[++at];
      in_word = true;
    } else if (c == '|' || c == '!') {
      finish();
      words.emplace_back(1, c);
    } else if (std::isspace(static_cast<unsigned char>(c))) {
      finish();
    } else {
      word += c;
      in_word = true;
    }
  }
  if (quote) throw UsageError(std::string("a ") + quote + " is not closed");
  finish();
  return words;
}

}  // namespace vdbdither
