#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace vdbdither {

/// Returns the pieces of `text` between commas, with their blanks. An empty text has one piece,
/// which is empty.
std::vector<std::string> commaList(std::string_view text);

}  // namespace vdbdither
