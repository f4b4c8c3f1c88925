#pragma once

#include <cstddef>
#include <string>
#include <string_view>

#include "io/digest.h"
#include "io/vdb.h"

namespace openvdb {
OPENVDB_USE_VERSION_NAMESPACE
namespace OPENVDB_VERSION_NAME {
namespace io {
class Stream;
}
}  // namespace OPENVDB_VERSION_NAME
}  // namespace openvdb

namespace vdbdither {

// An archive begins with an 8-byte magic number, three 4-byte versions and the seekable flag; its
// UUID follows.
inline constexpr std::size_t uuid_offset = 21;
inline constexpr std::size_t uuid_size = 36;

/// What stands for the UUID while the digest is taken.
inline constexpr std::string_view neutral_uuid = "00000000-0000-0000-0000-000000000000";

/// The digest in the form of a UUID of version 8 (RFC 9562: vendor-specific), which tells it from
/// OpenVDB's random ones.
std::string uuidOf(const Digest::Value& value);

/// Whether a UUID has that form.
bool isDigestUuid(std::string_view uuid);

/// What an archive that was read from a stream holds.
VdbContents contentsOf(openvdb::io::Stream& archive);

}  // namespace vdbdither
