#pragma once

#include <cstdint>
#include <istream>
#include <optional>
#include <string>

#include "io/vdb/vdb.h"

namespace vdbdither {

/// What one archive may hold at most. Larger ones are refused before they are read: OpenVDB trusts
/// every count and size of a file.
struct ArchiveLimits {
  std::uint32_t grids = 10000;
  std::uint32_t metadata_entries = 10000;       ///< of the file, and of each grid
  std::uint32_t name_bytes = 4096;              ///< of grids, types and keys
  std::uint64_t metadata_bytes = 64ULL << 20U;  ///< of all values of the file, or of a grid
  std::optional<double> memory_bytes = {};      ///< of all grids; else what is free
};

/// Reads the one archive of `stream`, which can seek and has `size` bytes. Names of grids and keys
/// of metadata are taken in their printable form (vdbdither/model/printable.h), and several grids
/// of one name are called name, name_2, …
///
/// The bytes are checked before OpenVDB reads them (archive_check.h): whatever they are, they are
/// read or refused. Of grids that no slab can carry, such as points, only the metadata are read.
///
/// Throws DataError that begins with `where` if the archive is damaged, exceeds the limits, or does
/// not end where the stream does.
VdbContents readArchive(std::istream& stream, std::uint64_t size, const std::string& where,
                        const ArchiveLimits& limits = {});

/// Returns what follows the end of an archive or of frames, to be refused: `another archive
/// follows`, or `12 bytes follow`.
///
/// \param begin  the first bytes that follow
/// \param size   the number of bytes that follow
std::string whatFollows(std::string_view begin, std::uint64_t size);

}  // namespace vdbdither
