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

/// Reads a grey PNG of 8 or 16 bits as values from 0 to 1, without correction for display, or the
/// unchanged values of an OpenEXR file: of its channel Y, or of the only one. Throws UsageError if
/// there is no such file, DataError if it is damaged, in colour, or holds values that are not
/// finite.
GreyImage readGreyImage(const std::filesystem::path& path);

}  // namespace vdbdither
