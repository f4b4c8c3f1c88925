#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace vdbdither {

/// Appends the lowest `size` bytes of `value`, the lowest first.
inline void putLittleEndian(std::vector<std::uint8_t>& bytes, std::uint64_t value, int size) {
  for (int i = 0; i < size; ++i) bytes.push_back(static_cast<std::uint8_t>(value >> 8 * i));
}

/// The value of the first `size` bytes, at most eight, the lowest first.
inline std::uint64_t littleEndian(std::span<const std::uint8_t> bytes, int size) {
  std::uint64_t value = 0;
  for (int i = 0; i < size; ++i)
    value |= std::uint64_t{bytes[static_cast<std::size_t>(i)]} << 8 * i;
  return value;
}

}  // namespace vdbdither
