#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <mutex>
#include <span>
#include <string>
#include <vector>

namespace vdbdither {

/// Writes a zip archive whose files are stored as they are; same files, same bytes. Throws
/// DataError naming `shown`.
class ZipWriter {
 public:
  ZipWriter(const std::filesystem::path& path, std::filesystem::path shown);
  ZipWriter(const ZipWriter&) = delete;
  ZipWriter& operator=(const ZipWriter&) = delete;
  ~ZipWriter();

  /// `name` is in UTF-8, with `/` between folders.
  void add(const std::string& name, std::span<const std::uint8_t> bytes);

  /// Writes the directory at the end of the archive. An archive without it cannot be read.
  void finish();

 private:
  [[noreturn]] void fail() const;

  std::filesystem::path shown_;
  void* file_ = nullptr;
};

/// Reads files of a zip archive by name. Safe to use from many threads.
class ZipReader {
 public:
  /// Throws DataError if the file is not a zip archive, or if members are encrypted, share a name
  /// or could be unpacked outside of a folder.
  explicit ZipReader(const std::filesystem::path& path);
  /// Reads an archive that lies in memory, with the same errors.
  /// @param bytes  must outlive the object
  /// @param shown  what messages call it: its name in quotes
  ZipReader(std::span<const std::uint8_t> bytes, std::string shown);
  ZipReader(const ZipReader&) = delete;
  ZipReader& operator=(const ZipReader&) = delete;
  ~ZipReader();

  [[nodiscard]] bool contains(const std::string& name) const { return members_.contains(name); }
  [[nodiscard]] std::vector<std::string> names() const;

  /// The size that the archive's directory states, in bytes. Throws DataError where there is no
  /// such file.
  [[nodiscard]] std::uint64_t size(const std::string& name) const { return member(name).bytes; }

  /// The whole file. Throws DataError where it is missing, has more than `most_bytes`, or its
  /// checksum is wrong. Never takes more memory than the stated size.
  [[nodiscard]] std::vector<std::uint8_t> read(const std::string& name, std::uint64_t most_bytes);

  /// Passes the file on in pieces of up to 64 KiB, with the same errors. The checksum is compared
  /// behind the last piece.
  void read(const std::string& name, std::uint64_t most_bytes,
            const std::function<void(std::span<const std::uint8_t>)>& take);

 private:
  /// Where a file lies: in the archive's directory, and its number there.
  struct Member {
    std::uint64_t offset = 0;
    std::uint64_t number = 0;
    std::uint64_t bytes = 0;  ///< unpacked
  };

  void takeOver(void* opened);
  void readDirectory();
  [[nodiscard]] const Member& member(const std::string& name) const;
  [[nodiscard]] std::string shown(const std::string& name) const;

  std::string shown_;  ///< the archive, in quotes
  void* file_ = nullptr;
  std::map<std::string, Member> members_;
  std::mutex mutex_;
};

}  // namespace vdbdither
