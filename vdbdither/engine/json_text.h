#pragma once

#include <string>
#include <string_view>

#include <nlohmann/json_fwd.hpp>

namespace vdbdither {

/// Returns `json` as text: on one line, or with `indent` blanks for each level. All JSON of the
/// program is written here.
///
/// The text is valid UTF-8 and has no effect on a terminal: bytes in keys and strings that are not
/// UTF-8 become `\xNN` (as characters of the string), and characters that are not printable are
/// written as JSON escapes.
std::string jsonText(nlohmann::ordered_json json, int indent = -1);

/// Returns the JSON that `text` holds. The value is discarded (`is_discarded()`) if the text is not
/// JSON, nests deeper than 100 levels, which functions that follow the levels could not bear, or
/// holds a number beyond the range of double. All JSON that is read is parsed here, but for glTF.
nlohmann::ordered_json parsedJson(std::string_view text);

/// Returns why parsedJson discards `text`, with line and column, or nothing if it does not:
/// "line 3, column 12: this is not JSON: …".
std::string jsonProblem(std::string_view text);

}  // namespace vdbdither
