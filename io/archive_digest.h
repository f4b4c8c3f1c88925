#pragma once

#include <cstddef>
#include <cstdint>
#include <iosfwd>
#include <string>
#include <string_view>

#include "io/digest.h"
#include "io/vdb.h"

namespace vdbdither {

// An archive begins with an 8-byte magic number, three 4-byte versions and the seekable flag; its
// UUID follows.
inline constexpr std::size_t uuid_offset = 21;
inline constexpr std::size_t uuid_size = 36;

/// What stands for the UUID while the digest is taken.
inline constexpr std::string_view neutral_uuid = "00000000-0000-0000-0000-000000000000";

/// The beginning of the digest and, in the last twelve digits, the archive's size in bytes, in the
/// form of a UUID of version 8 (RFC 9562: vendor-specific), which tells it from OpenVDB's random
/// ones. OpenVDB crashes or hangs on some damaged archives, so both are checked before it reads.
std::string uuidOf(const Digest::Value& value, std::uint64_t size);

/// Whether a UUID has that form.
bool isDigestUuid(std::string_view uuid);

/// The size that such a UUID states.
std::uint64_t sizeIn(std::string_view digest_uuid);

/// The UUID that `archive` should have.
std::string uuidOf(std::string_view archive);

/// Takes the archive off `stream` and leaves what follows. Throws DataError, without the name of
/// the stream.
VdbContents readArchive(std::istream& stream);

}  // namespace vdbdither
