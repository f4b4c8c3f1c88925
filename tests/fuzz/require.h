#pragma once

#include <cstdlib>
#include <string_view>

namespace vdbdither {

/// Ends the program, which a fuzzer takes for a find.
inline void require(bool condition) {
  if (!condition) std::abort();
}

inline bool isOneLine(std::string_view message) {
  return message.find_first_of("\r\n") == std::string_view::npos;
}

}  // namespace vdbdither
