#pragma once

#include <filesystem>
#include <vector>

namespace vdbdither {

/// An image of one channel.
struct GreyImage {
  int width = 0;
  int height = 0;
  std::vector<float> values;  ///< row by row, the top first
};

/// Reads a grey PNG of 8 or 16 bits, as 0 … 1 without any correction for display, or an OpenEXR
/// file, as its numbers are: its channel Y, or the only one. Throws UsageError where there is no
/// such file, DataError where it is damaged, in colour, or holds values that are not finite.
GreyImage readGreyImage(const std::filesystem::path& path);

}  // namespace vdbdither
