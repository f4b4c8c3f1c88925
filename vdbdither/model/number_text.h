#pragma once

#include <array>
#include <charconv>
#include <string>

namespace vdbdither {

/// Returns the shortest decimals that read back as `value`.
inline std::string numberText(double value) {
  std::array<char, 32> digits{};
  return {digits.begin(), std::to_chars(digits.begin(), digits.end(), value).ptr};
}

}  // namespace vdbdither
