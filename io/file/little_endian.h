#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "vdbdither/model/errors.h"

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

/// Takes values off the front of bytes.
class LittleEndianReader {
 public:
  explicit LittleEndianReader(std::span<const std::uint8_t> bytes) : rest_(bytes) {}

  /// The value of the next `size` bytes, at most eight. Throws DataError where there are fewer, in
  /// words that go on from the name of what holds them.
  std::uint64_t take(int size) {
    if (rest_.size() < static_cast<std::size_t>(size)) throw DataError("is cut short");
    const std::uint64_t value = littleEndian(rest_, size);
    rest_ = rest_.subspan(static_cast<std::size_t>(size));
    return value;
  }

  [[nodiscard]] std::span<const std::uint8_t> rest() const { return rest_; }

 private:
  std::span<const std::uint8_t> rest_;
};

}  // namespace vdbdither
