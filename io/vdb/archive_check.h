#pragma once

#include <cstdint>
#include <istream>
#include <string>

#include "io/vdb/archive_reader.h"
#include "vdbdither/model/errors.h"

namespace vdbdither {

/// Passes over the one archive of `stream`, which begins at its position, without reading a value,
/// and checks all that OpenVDB would trust: counts, sizes and places. Leaves the stream where it
/// was. Throws DataError as `readArchive` does, and std::ios::failure where the bytes end too
/// early.
///
/// \param part  receives what is checked, for messages
void checkArchive(std::istream& stream, std::uint64_t size, const std::string& where,
                  const ArchiveLimits& limits, std::string& part);

/// Whether the voxels of a grid of this type are read. Those of others, such as points, are passed
/// over.
bool hasReadVoxels(const std::string& type);

/// The refusal of an archive, with the reason.
DataError unreadableArchive(const std::string& where, const std::string& why);

}  // namespace vdbdither
