#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

namespace vdbdither {

/// Pixels of eight bits a channel, sRGB-coded, with straight alpha; see rgba(). Top row first.
struct Picture {
  std::uint32_t width = 0;
  std::uint32_t height = 0;
  std::vector<std::uint32_t> pixels;

  friend bool operator==(const Picture&, const Picture&) = default;
};

/// Reads a PNG of any kind. Throws DataError.
Picture readPicture(const std::filesystem::path& path);

/// The bytes of a PNG of 32 bits a pixel, for pictures of many shades (of few, encodePng is much
/// faster). Throws DataError where libpng refuses the picture.
std::vector<std::uint8_t> encodePicture(const Picture& picture);

}  // namespace vdbdither
