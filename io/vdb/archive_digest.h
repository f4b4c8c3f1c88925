#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>

#include "io/file/digest.h"
#include "io/vdb/vdb.h"

namespace vdbdither {

// An archive begins with an 8-byte magic number, three 4-byte versions and the seekable flag; its
// UUID follows.
inline constexpr std::size_t uuid_offset = 21;
inline constexpr std::size_t uuid_size = 36;

/// What OpenVDB needs to see of an archive before it is read: the part up to the end of its UUID.
inline constexpr std::size_t archive_head_size = uuid_offset + uuid_size;

/// The UUID of an archive that this program writes. Its version is 8 (RFC 9562: vendor-specific);
/// the random ones of OpenVDB have another. 48 bits are the archive's length in bytes, 72 bits the
/// beginning of the SHA-256 of all its other bytes.
class ArchiveDigest {
 public:
  /// Takes the bytes of an archive as they come; whatever UUID they hold is left out.
  void update(const char* bytes, std::size_t size);

  [[nodiscard]] std::string uuid();

 private:
  Digest digest_;
  std::size_t size_ = 0;
};

/// The length that the UUID within an archive's head states; nothing where another tool wrote it.
std::optional<std::size_t> statedLength(std::string_view head);

/// Checks and reads an archive. `where` names its origin in errors. Throws DataError.
VdbContents contentsOfBytes(std::string_view bytes, const std::string& where);

}  // namespace vdbdither
