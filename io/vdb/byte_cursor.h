#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <istream>
#include <vector>

namespace vdbdither {

/// Goes over the bytes of a stream that can seek and throws `std::ios::failure` where they end too
/// early. Holds few of them at a time, and passes over others without reading them.
class ByteCursor {
 public:
  /// Begins where `stream` is, which has `size` bytes and throws where a read fails.
  ByteCursor(std::istream& stream, std::uint64_t size);

  [[nodiscard]] std::uint64_t position() const { return buffer_begin_ + at_; }
  [[nodiscard]] std::uint64_t left() const { return size_ - position(); }

  /// Returns the next `count` bytes, which stay valid until the next call.
  const char* view(std::size_t count);

  /// The same, and passes over them.
  const char* take(std::size_t count) {
    const char* bytes = view(count);
    at_ += count;
    return bytes;
  }

  /// Returns a number as it lies in the bytes.
  template <typename T>
  T take() {
    T value{};
    std::memcpy(&value, take(sizeof value), sizeof value);
    return value;
  }

  void skip(std::uint64_t count);

  /// Throws std::ios::failure if fewer bytes are left.
  void require(std::uint64_t count) const;

 private:
  void fill(std::size_t count);

  std::istream& stream_;
  std::uint64_t size_;
  std::uint64_t buffer_begin_;  ///< position of the buffer in the stream
  std::vector<char> buffer_;
  std::size_t at_ = 0;   ///< in the buffer
  std::size_t end_ = 0;  ///< of what the buffer holds
};

}  // namespace vdbdither
