#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

namespace vdbdither::test {

/// A PNG read by libpng.
struct PngImage {
  std::uint32_t width = 0;
  std::uint32_t height = 0;
  int bit_depth = 0;
  int colour_type = 0;  ///< 0: grey, 6: RGBA
  std::uint32_t dots_per_metre_x = 0;
  std::uint32_t dots_per_metre_y = 0;
  std::vector<std::uint8_t> rows;  ///< as stored: packed if a pixel has one bit
};

/// Reads a PNG. Fails the test on any error or warning of libpng, and on bytes after the image.
PngImage readPng(const std::vector<std::uint8_t>& bytes);

std::vector<std::uint8_t> fileBytes(const std::filesystem::path& path);

}  // namespace vdbdither::test
