#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "io/image/size_check.h"
#include "vdbdither/model/span_image.h"

namespace vdbdither {

/// Returns a BMP of one bit a pixel: 0 is black, any other value white.
/// @param pixel_width_mm, pixel_height_mm  for the resolution in the file
std::vector<std::uint8_t> encodeBmp(const SpanImage& image, double pixel_width_mm,
                                    double pixel_height_mm);

/// Returns the bits of a BMP of one bit a pixel, uncompressed: 1 where its colour is light. Throws
/// DataError in words that go on from the file's name.
/// @param check  gets the size before the pixels are read
SpanImage decodeBmp(std::span<const std::uint8_t> bytes, const SizeCheck& check = {});

}  // namespace vdbdither
