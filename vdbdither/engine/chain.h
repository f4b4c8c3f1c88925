#pragma once

#include <functional>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "vdbdither/engine/registry.h"
#include "vdbdither/engine/run_options.h"
#include "vdbdither/engine/stage.h"

namespace vdbdither {

/// One step of a chain as it was written: a verb and its arguments.
struct Step {
  std::string verb;
  std::vector<std::string> arguments;
};

/// Cuts words at every separator (`!` or `|`). Throws UsageError if a step is empty.
std::vector<Step> parseChain(std::span<const std::string> words);

/// Cuts a line into words as a shell does: blanks separate, quotes, `$'...'` with its escapes and
/// backslashes keep together. An unquoted `|` or `!` is a word of its own, wherever it stands. A
/// `#` that is a whole word begins a comment, up to the end of the line. Throws UsageError for a
/// quote that is not closed.
std::vector<std::string> splitWords(const std::string& line);

using FindOperator = std::function<const OperatorInfo&(std::string_view)>;

/// The stages of a chain with their arguments read: a source, then filters and sinks. A chain that
/// begins without a source gets `read` (a file or standard input) in front, one that ends without a
/// sink gets `write`.
class Chain {
 public:
  /// `find` looks operators up by their verbs. Throws UsageError.
  explicit Chain(const std::vector<Step>& steps, const FindOperator& find = findOperator);
  Chain(const Chain&) = delete;
  Chain& operator=(const Chain&) = delete;

  [[nodiscard]] const RunOptions& options() const { return options_; }
  /// The operator whose --help was asked for, or null. If there is one, the chain has no stages.
  [[nodiscard]] const OperatorInfo* helpWanted() const { return help_; }
  [[nodiscard]] std::span<const std::unique_ptr<Stage>> stages() const { return stages_; }

 private:
  void addStage(const Step& step, const FindOperator& find);
  void addRead(const FindOperator& find);
  void addWrite(const FindOperator& find);
  /// Sets the --overwrite of every stage that has one.
  void overwriteAll();

  RunOptions options_;
  Options run_options_;  ///< bound to `options_`
  const OperatorInfo* help_ = nullptr;
  std::string named_input_;  ///< by the first stage, in front of its own words
  std::vector<std::unique_ptr<Stage>> stages_;
};

}  // namespace vdbdither
