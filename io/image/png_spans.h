#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "vdbdither/model/span_image.h"

namespace vdbdither {

enum class PngPixels {
  rgba8,  ///< 32 bits: red, green, blue, alpha
  grey8,  ///< 0 … 255
  grey1,  ///< 1 bit: 0 black, else white
};

/// A colour as a span's value holds it, red in the lowest byte.
constexpr std::uint32_t rgba(std::uint8_t red, std::uint8_t green, std::uint8_t blue,
                             std::uint8_t alpha = 255) {
  return red | green << 8 | blue << 16 | static_cast<std::uint32_t>(alpha) << 24;
}

/// The same of a colour of four channels.
constexpr std::uint32_t rgba(const std::array<std::uint8_t, 4>& colour) {
  return rgba(colour[0], colour[1], colour[2], colour[3]);
}

struct PngFormat {
  PngPixels pixels = PngPixels::rgba8;
  /// What the values of the spans stand for; empty where they are pixels themselves.
  std::span<const std::uint32_t> palette;
  /// Size of a pixel, mm, for the file's pHYs; zero leaves it out.
  double pixel_width_mm = 0;
  double pixel_height_mm = 0;
};

/// The bytes of a PNG file of `image`. The cost follows the spans, not the pixels: matches are
/// written straight from them, and no pixel is ever made. Same image, same bytes. Throws DataError
/// for an image without pixels.
std::vector<std::uint8_t> encodePng(const SpanImage& image, const PngFormat& format);

}  // namespace vdbdither
