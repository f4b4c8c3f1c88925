#pragma once

#include <cstdint>
#include <vector>

#include <openvdb/Types.h>

namespace vdbdither {

/// Heights in mm over a plane, projected along an axis and repeated without end.
class HeightMap {
 public:
  /// \param heights_mm  row by row, the top first
  /// \param axis        along which it is projected, 0 … 2; its rows run along the first of the
  /// other
  ///                    two axes and its columns up the second
  /// \param pixel_mm    edge of a pixel
  /// \param corner_mm   where the lower left corner of the image lies, on the two other axes
  HeightMap(std::vector<float> heights_mm, int width, int height, int axis, double pixel_mm,
            const openvdb::Vec2d& corner_mm);

  /// Bilinear between the centres of pixels.
  [[nodiscard]] double at(const openvdb::Vec3d& position_mm) const;

  /// The least and the greatest height.
  [[nodiscard]] double leastMm() const { return least_mm_; }
  [[nodiscard]] double greatestMm() const { return greatest_mm_; }

 private:
  std::vector<float> heights_mm_;
  std::int64_t width_, height_;
  int across_, up_;  ///< the axes
  double pixel_mm_;
  openvdb::Vec2d corner_mm_;
  double least_mm_, greatest_mm_;
};

}  // namespace vdbdither
