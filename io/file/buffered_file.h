#pragma once

#include <bit>
#include <cstddef>
#include <filesystem>
#include <string_view>
#include <sys/types.h>
#include <type_traits>
#include <vector>

namespace vdbdither {

/// A new file, written from its beginning to its end through a buffer of 1 MiB. Every function
/// throws DataError where the file cannot be written.
class BufferedFile {
 public:
  /// @param path   an existing file is replaced
  /// @param shown  the name of the file in errors
  BufferedFile(const std::filesystem::path& path, std::filesystem::path shown);
  BufferedFile(const BufferedFile&) = delete;
  BufferedFile& operator=(const BufferedFile&) = delete;
  ~BufferedFile();

  void append(const void* data, std::size_t size) {
    if (buffer_.size() + size > buffer_bytes) flush();
    const auto* bytes = static_cast<const char*>(data);
    buffer_.insert(buffer_.end(), bytes, bytes + size);
  }
  void append(std::string_view text) { append(text.data(), text.size()); }
  /// Appends the bytes of a value, the lowest first.
  template <typename T>
  void appendValue(const T& value) {
    static_assert(std::endian::native == std::endian::little);
    static_assert(std::is_trivially_copyable_v<T> && !std::is_pointer_v<T>);
    append(&value, sizeof(T));
  }
  /// Appends the shortest text that reads back as the same float.
  void appendNumber(float value);
  /// Appends everything that was written to `other`.
  void appendAllOf(BufferedFile& other);

  /// Overwrites what was written at `offset`, in bytes.
  void patch(off_t offset, const void* data, std::size_t size);

  /// Writes what is still in the buffer and closes the file.
  void close();

 private:
  static constexpr std::size_t buffer_bytes = std::size_t{1} << 20;

  void flush();
  [[noreturn]] void fail() const;

  std::filesystem::path shown_;
  int file_;
  std::vector<char> buffer_;
};

}  // namespace vdbdither
