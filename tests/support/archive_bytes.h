#pragma once

#include <cstdint>
#include <cstring>
#include <sstream>
#include <string>

#include <openvdb/io/Stream.h>

#include "vdbdither/model/openvdb.h"

namespace vdbdither::test {

// Parts of VDB archives as bytes, from which archives of other tools and hostile ones are made.

template <typename T>
std::string bytesOf(T value) {
  std::string bytes(sizeof value, '\0');
  std::memcpy(bytes.data(), &value, sizeof value);
  return bytes;
}

inline std::string count(std::uint32_t number) { return bytesOf(number); }

inline std::string sized(const std::string& text) {
  return count(static_cast<std::uint32_t>(text.size())) + text;
}

/// The header of an archive of another tool, without its metadata.
/// \param states_ends  whether grids state where they end
inline std::string archiveHeader(std::uint32_t version = openvdb::OPENVDB_FILE_VERSION,
                                 bool states_ends = false) {
  return bytesOf(std::int64_t{openvdb::OPENVDB_MAGIC}) + bytesOf(version) + count(10) + count(0) +
         std::string(1, states_ends ? '\1' : '\0') + "0856ea5b-a483-4314-a8bd-a286b9e7daa0";
}

inline std::string metadataEntry(const std::string& key, const std::string& type,
                                 const std::string& value) {
  return sized(key) + sized(type) + sized(value);
}

/// What other tools write to a pipe.
inline std::string streamOf(const openvdb::GridCPtrVec& grids,
                            const openvdb::MetaMap& metadata = {},
                            std::uint32_t compression = openvdb::io::COMPRESS_ACTIVE_MASK |
                                                        openvdb::io::COMPRESS_BLOSC) {
  std::ostringstream bytes(std::ios::binary);
  openvdb::io::Stream stream(bytes);
  stream.setCompression(compression);
  stream.write(grids, metadata);
  return bytes.str();
}

}  // namespace vdbdither::test
