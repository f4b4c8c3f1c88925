#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "vdbdither/model/appearance.h"

namespace vdbdither {

/// Returns the index, below `size`, of the texel that a texture shows at any index.
std::uint32_t wrappedTexel(std::int64_t at, std::uint32_t size, TextureWrap wrap);

/// The texels of a texture that some triangle shows, and their neighbours. What lies between the
/// charts of an atlas is often black, and must not be averaged with them.
class TextureCoverage {
 public:
  TextureCoverage(std::uint32_t width, std::uint32_t height)
      : width_(width), height_(height), shown_(std::size_t{width} * height, 0) {}

  /// Adds the texels that a triangle shows.
  void add(const Appearance::Coordinates& corners, const std::array<TextureWrap, 2>& wrap);

  /// Returns 255 for each texel that is shown and 0 for others, row by row from the top.
  [[nodiscard]] const std::vector<std::uint8_t>& shown() const { return shown_; }

 private:
  std::uint32_t width_, height_;
  std::vector<std::uint8_t> shown_;
};

}  // namespace vdbdither
