#pragma once

#include <span>
#include <string>
#include <vector>

namespace vdbdither {

/// One step of a chain as it was written: a verb and its arguments.
struct Step {
  std::string verb;
  std::vector<std::string> arguments;
};

/// Cuts words at every separator (`!` or `|`). Throws UsageError where a step is empty.
std::vector<Step> parseChain(std::span<const std::string> words);

/// Cuts a line into words as a shell would: blanks separate, quotes, `$'...'` with its escapes and
/// backslashes keep together. An unquoted `|` or `!` is a word of its own, wherever it stands. A
/// `#` that is a whole word begins a comment, up to the end of the line. Throws UsageError for a
/// quote that is not closed.
std::vector<std::string> splitWords(const std::string& line);

}  // namespace vdbdither
