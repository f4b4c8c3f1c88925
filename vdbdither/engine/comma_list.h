#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace vdbdither {

/// What commas part, blanks and all: one piece more than there are commas, so of an empty text one
/// that is empty.
std::vector<std::string> commaList(std::string_view text);

}  // namespace vdbdither
