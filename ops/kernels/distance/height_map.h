#pragma once

#include <cstdint>
#include <vector>

#include <openvdb/Types.h>

namespace vdbdither {

/// Heights in mm over a plane, projected along an axis and repeated in both directions.
class HeightMap {
 public:
  /// \param heights_mm  row by row, the top row first
  /// \param axis  of the projection, 0 … 2; of the other two axes, rows run along the first and
  /// columns up the second
  /// \param pixel_mm  the edge of a pixel
  /// \param corner_mm  the lower left corner of the image, on the other two axes
  HeightMap(std::vector<float> heights_mm, int width, int height, int axis, double pixel_mm,
            const openvdb::Vec2d& corner_mm);

  /// Returns the height, interpolated bilinearly between the centres of pixels.
  [[nodiscard]] double at(const openvdb::Vec3d& position_mm) const;

  /// The minimum and the maximum height.
  [[nodiscard]] double minimumMm() const { return minimum_mm_; }
  [[nodiscard]] double maximumMm() const { return maximum_mm_; }

 private:
  std::vector<float> heights_mm_;
  std::int64_t width_, height_;
  int across_, up_;  ///< the axes
  double pixel_mm_;
  openvdb::Vec2d corner_mm_;
  double minimum_mm_, maximum_mm_;
};

}  // namespace vdbdither
