#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

namespace vdbdither {

/// The size and the digest of a file.
struct FileDigest {
  std::uint64_t bytes = 0;
  std::string sha256;  ///< hexadecimal

  friend bool operator==(const FileDigest&, const FileDigest&) = default;
};

/// Reads a file in pieces, whatever its size. Throws DataError, and Interrupted if the run is to
/// stop.
FileDigest digestOfFile(const std::filesystem::path& path);

}  // namespace vdbdither
