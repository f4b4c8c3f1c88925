#include "vdbdither/engine/chain.h"

#include <algorithm>
#include <cctype>
#include <string>

#include "vdbdither/engine/named_file.h"
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

namespace {

/// What `\` and the characters behind it stand for in `$'...'`, which `at` is moved beyond.
char unescaped(const std::string& line, std::size_t& at) {
  const auto digit = [&](std::size_t place) {
    const char c = place < line.size() ? line[place] : ' ';
    return std::isxdigit(static_cast<unsigned char>(c)) != 0;
  };
  const char c = line[++at];
  if (c == 'n') return '\n';
  if (c == 't') return '\t';
  if (c == 'r') return '\r';
  if (c != 'x' || !digit(at + 1) || !digit(at + 2)) return c;
  at += 2;
  return static_cast<char>(std::stoi(line.substr(at - 1, 2), nullptr, 16));
}

}  // namespace

std::vector<std::string> splitWords(const std::string& line) {
  std::vector<std::string> words;
  std::string word;
  bool in_word = false;
  bool escapes = false;  // in a `$'...'`
  char quote = 0;
  const auto finish = [&] {
    if (in_word) words.push_back(word);
    word.clear();
    in_word = false;
  };
  const auto isBlank = [&](std::size_t at) {
    return at >= line.size() || std::isspace(static_cast<unsigned char>(line[at]));
  };
  for (std::size_t at = 0; at < line.size(); ++at) {
    const char c = line[at];
    const bool has_next = at + 1 < line.size();
    if (quote) {
      if (c == quote) {
        quote = 0;
      } else if (c == '\\' && escapes && has_next) {
        word += unescaped(line, at);
      } else {
        word += c == '\\' && quote == '"' && has_next ? line[++at] : c;
      }
    } else if (c == '\'' || c == '"' || (c == '$' && has_next && line[at + 1] == '\'')) {
      escapes = c == '$';
      if (escapes) ++at;
      quote = escapes ? '\'' : c;
      in_word = true;
    } else if (c == '\\' && has_next) {
      word += line[++at];
      in_word = true;
    } else if (c == '|' || c == '!') {
      finish();
      words.emplace_back(1, c);
    } else if (isBlank(at)) {
      finish();
    } else if (c == '#' && !in_word && isBlank(at + 1)) {
      at = std::min(line.find('\n', at), line.size());
    } else {
      word += c;
      in_word = true;
    }
  }
  if (quote) throw UsageError(std::string("a ") + quote + " is not closed");
  finish();
  return words;
}

Chain::Chain(const std::vector<Step>& steps, const FindOperator& find) {
  options_.declare(run_options_);
  for (const Step& step : steps) {
    addStage(step, find);
    if (help_) return;
  }
  addRead(find);
  addWrite(find);
  if (options_.overwrite) overwriteAll();
}

void Chain::addStage(const Step& step, const FindOperator& find) {
  const OperatorInfo& info = find(step.verb);
  if (asksForHelp(step.arguments)) {
    help_ = &info;
    stages_.clear();
    return;
  }
  auto stage = std::make_unique<Stage>(info);
  std::vector<std::string> arguments = step.arguments;
  if (!stage->source()) {
    const std::string file = takeNamedFile(arguments, info, stage->options(), run_options_);
    if (!file.empty()) refuseNamedFile(info, file, !stages_.empty());
    if (stages_.empty()) named_input_ = file;
  } else if (!stages_.empty()) {
    throw UsageError(stage->name() + ": makes slabs of its own and can only begin a chain");
  }
  stage->parse(arguments, run_options_);
  stages_.push_back(std::move(stage));
}

void Chain::addRead(const FindOperator& find) {
  const std::string first = stages_.front()->name();
  if (stages_.front()->source()) {
    if (options_.input.empty()) return;
    throw UsageError("--input: the chain begins with " + first + ", which reads its own input");
  }
  if (!named_input_.empty() && !options_.input.empty())
    throw UsageError("--input: " + first + " reads '" + named_input_ + "'");
  const std::string& path = named_input_.empty() ? options_.input : named_input_;
  auto stage = std::make_unique<Stage>(find("read"));
  stage->parse(path.empty() ? std::vector<std::string>{} : std::vector{path}, run_options_);
  stages_.insert(stages_.begin(), std::move(stage));
}

void Chain::addWrite(const FindOperator& find) {
  if (stages_.back()->sink()) {
    if (options_.output.empty()) return;
    throw UsageError("--output: the chain ends with " + stages_.back()->name() +
                     ", which names its own output");
  }
  const std::vector<std::string> arguments{options_.output.empty() ? "-" : options_.output};
  auto stage = std::make_unique<Stage>(find("write"));
  stage->parse(arguments, run_options_);
  stages_.push_back(std::move(stage));
}

void Chain::overwriteAll() {
  for (const auto& stage : stages_)
    if (const Option* own = stage->options().find("overwrite")) own->set("");
}

}  // namespace vdbdither
