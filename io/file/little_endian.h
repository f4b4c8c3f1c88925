#pragma once

#include <cstdint>
#include <vector>

namespace vdbdither {

/// Appends the lowest `size` bytes of `value`, the lowest first.
inline void putLittleEndian(std::vector<std::uint8_t>& bytes, std::uint64_t value, int size) {
  for (int i = 0; i < size; ++i) bytes.push_back(static_cast<std::uint8_t>(value >> 8 * i));
}

}  // namespace vdbdither
