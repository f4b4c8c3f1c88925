#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>

#include <ImfHeader.h>

#include "io/image/exr_source.h"

namespace vdbdither {

// What an EXR makes OpenEXR allocate is checked here before OpenEXR opens it. All throw DataError
// in words that go on from the file's name.

struct ExrSize {
  std::uint32_t width = 0;
  std::uint32_t height = 0;
};

/// Returns the header of the first part, and moves `source` back to its begin. Refuses deep files,
/// and attributes that claim more than the file holds.
Imf::Header readExrHeader(ExrSource& source);

/// The size of the data window. Refuses an empty one.
ExrSize exrSizeOf(const Imf::Header& header);

/// What a pixel takes unpacked, with all channels.
std::uint64_t exrPixelBytes(const Imf::Header& header);

/// Refuses chunks that take too much memory to unpack, and a file that is shorter than the table of
/// its chunks.
/// @param most_held_pixels  of the rows that a row of chunks has
void checkExrChunks(const Imf::Header& header, std::size_t file_bytes,
                    std::uint64_t most_held_pixels = std::numeric_limits<std::uint64_t>::max());

}  // namespace vdbdither
