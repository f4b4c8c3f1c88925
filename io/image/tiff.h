#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "io/image/size_check.h"
#include "vdbdither/model/span_image.h"

namespace vdbdither {

struct TiffFormat {
  /// The colour of every value (see rgba()), up to 256; empty: one bit a pixel, black for 0 and
  /// white for all else.
  std::span<const std::uint32_t> palette;
  /// Size of a pixel, mm.
  double pixel_width_mm = 1;
  double pixel_height_mm = 1;
};

/// The bytes of a TIFF file: one bit a pixel packed by CCITT group 4, or a palette of eight bits
/// packed by LZW. Same image, same bytes. Throws DataError for an image without pixels, and for
/// more than 256 colours.
std::vector<std::uint8_t> encodeTiff(const SpanImage& image, const TiffFormat& format);

/// The pixels of a TIFF of one bit or of eight with one sample: bits, or what indexes the palette.
/// Read row by row. Throws DataError in words that go on from the file's name.
/// @param check  gets the size before the pixels are read
SpanImage decodeTiff(std::span<const std::uint8_t> bytes, const SizeCheck& check = {});

}  // namespace vdbdither
