#pragma once

#include <string>

#include <nlohmann/json_fwd.hpp>

namespace vdbdither {

/// Returns `json` as text: on one line, or with `indent` blanks for each level. All JSON of the
/// program is written here.
///
/// The text is valid UTF-8 and has no effect on a terminal: bytes in keys and strings that are not
/// UTF-8 become `\xNN` (as characters of the string), and characters that are not printable are
/// written as JSON escapes.
std::string jsonText(nlohmann::ordered_json json, int indent = -1);

}  // namespace vdbdither
