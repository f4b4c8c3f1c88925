#pragma once

#include <cstddef>
#include <ctime>
#include <string>
#include <string_view>

namespace vdbdither {

/// The bytes of a regular file, which are read when they are needed. They are not mapped: whoever
/// cuts a mapped file off ends the program.
class FileBytes {
 public:
  /// Opens the file and reads its head. Throws DataError where it is no regular file, cannot be
  /// read or does not fit into memory.
  explicit FileBytes(std::string path);
  FileBytes(const FileBytes&) = delete;
  FileBytes& operator=(const FileBytes&) = delete;
  ~FileBytes();

  [[nodiscard]] const std::string& path() const { return path_; }
  [[nodiscard]] std::size_t size() const { return size_; }
  /// The first 64 KiB, or all bytes of a smaller file.
  [[nodiscard]] std::string_view head() const;
  /// All bytes; they begin at the address of the head. The first call reads them. Throws DataError
  /// where the file cannot be read or has changed since it was opened, and Interrupted.
  std::string_view all();

 private:
  [[noreturn]] void refuse(const std::string& why) const;
  [[noreturn]] void refuseSize() const;
  void open();
  void close();
  void readUpTo(std::size_t end);

  std::string path_;
  int file_ = -1;
  std::size_t size_ = 0;
  timespec changed_{};
  char* bytes_ = nullptr;
  std::size_t read_ = 0;
};

}  // namespace vdbdither
