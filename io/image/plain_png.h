#pragma once

#include <cstdint>
#include <optional>
#include <span>

#include "io/image/colour_image.h"

namespace vdbdither {

/// Reads a PNG of a kind that most slices are of: colour and opacity or grey of 8 bits, or grey of
/// one bit, without interlace and a transparent colour. Several times as fast as libpng where spans
/// are long. Returns nothing for any other kind, and for what is damaged: libpng tells why.
/// @param check  gets the size before the pixels are read
std::optional<ColourImage> decodePlainPng(std::span<const std::uint8_t> bytes,
                                          const SizeCheck& check);

}  // namespace vdbdither
