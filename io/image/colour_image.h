#pragma once

#include <cstdint>
#include <span>

#include "io/image/size_check.h"
#include "vdbdither/model/span_image.h"

namespace vdbdither {

/// An image of pixels whose exact values count, not how they look.
struct ColourImage {
  SpanImage pixels;  ///< colours as rgba() makes them, as they are encoded; opacity is straight
  bool is_grey = false;
  bool has_opacity = false;
  bool is_rgba8 = false;  ///< whether the file has 32 bits a pixel: colour and opacity
};

/// The pixels of a PNG, as decodePng() reads them.
ColourImage decodePngImage(std::span<const std::uint8_t> bytes, const SizeCheck& check);

/// The pixels of a TIFF: grey of 1, 8 or 16 bits, RGB of 8 or 16 bits, both with or without
/// opacity, or a palette of 8 bits. Of 16 bits the upper 8 are taken. Throws DataError in words
/// that go on from the file's name.
/// @param check  gets the size before the pixels are read
ColourImage decodeTiffImage(std::span<const std::uint8_t> bytes, const SizeCheck& check);

}  // namespace vdbdither
