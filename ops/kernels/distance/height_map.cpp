#include "ops/kernels/distance/height_map.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace vdbdither {

HeightMap::HeightMap(std::vector<float> heights_mm, int width, int height, int axis,
                     double pixel_mm, const openvdb::Vec2d& corner_mm)
    : heights_mm_(std::move(heights_mm)),
      width_(width),
      height_(height),
      across_(axis == 0 ? 1 : 0),
      up_(axis == 2 ? 1 : 2),
      pixel_mm_(pixel_mm),
      corner_mm_(corner_mm),
      minimum_mm_(double{*std::min_element(heights_mm_.begin(), heights_mm_.end())}),
      maximum_mm_(double{*std::max_element(heights_mm_.begin(), heights_mm_.end())}) {}

double HeightMap::at(const openvdb::Vec3d& position_mm) const {
  const double x = (position_mm[across_] - corner_mm_[0]) / pixel_mm_ - 0.5;
  const double y =
      static_cast<double>(height_) - (position_mm[up_] - corner_mm_[1]) / pixel_mm_ - 0.5;
  const double column = std::floor(x);
  const double row = std::floor(y);
  const auto value = [&](std::int64_t i, std::int64_t j) {
    const std::int64_t at_x = (i % width_ + width_) % width_;
    const std::int64_t at_y = (j % height_ + height_) % height_;
    return double{heights_mm_[static_cast<std::size_t>(at_y * width_ + at_x)]};
  };
  const auto i = static_cast<std::int64_t>(column);
  const auto j = static_cast<std::int64_t>(row);
  const double s = x - column;
  const double t = y - row;
  return (1 - t) * ((1 - s) * value(i, j) + s * value(i + 1, j)) +
         t * ((1 - s) * value(i, j + 1) + s * value(i + 1, j + 1));
}

}  // namespace vdbdither
