#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include <openvdb/openvdb.h>

#include "ops/kernels/leaf/leaf_window.h"
#include "ops/kernels/printing/normal_distribution.h"

namespace vdbdither {

inline constexpr double maximum_quantile = 2.5;

/// Φ⁻¹ of a blurred share, within ±maximum_quantile, from a table: the place of a share in front of
/// a flat face, in standard deviations, which is what can be interpolated.
class BlurQuantile {
 public:
  BlurQuantile() {
    for (std::size_t n = 0; n < table_.size(); ++n)
      table_[n] = static_cast<float>(
          std::clamp(probit(static_cast<double>(n) / cells), -maximum_quantile, maximum_quantile));
  }
  [[nodiscard]] float operator()(float share) const {
    const float place = std::clamp(share, 0.0F, 1.0F) * cells;
    const auto cell = std::min(static_cast<int>(place), cells - 1);
    const float* value = &table_[static_cast<std::size_t>(cell)];
    return value[0] + (place - static_cast<float>(cell)) * (value[1] - value[0]);
  }

 private:
  static constexpr int cells = 8192;
  std::array<float, cells + 1> table_;
};

/// Returns the weights of Catmull and Rom's cubic for the samples from −1 to 2.
inline std::array<float, 4> cubicWeights(float t) {
  return {-0.5F * t * (1 - t) * (1 - t), 0.5F * (2 - 5 * t * t + 3 * t * t * t),
          0.5F * t * (1 + 4 * t - 3 * t * t), -0.5F * t * t * (1 - t)};
}

/// Interpolates by cubics at a place in voxels from the leaf's origin.
inline float interpolated(const LeafWindow& window, const openvdb::Vec3s& place) {
  std::array<int, 3> cell{};
  std::array<std::array<float, 4>, 3> weights{};
  for (int axis = 0; axis < 3; ++axis) {
    const float floor = std::floor(place[axis]);
    cell[static_cast<std::size_t>(axis)] = static_cast<int>(floor);
    weights[static_cast<std::size_t>(axis)] = cubicWeights(place[axis] - floor);
  }
  const float* first = window.at(cell[0] - 1, cell[1] - 1, cell[2] - 1);
  float sum = 0;
  for (std::size_t x = 0; x < 4; ++x) {
    float sum_x = 0;
    for (std::size_t y = 0; y < 4; ++y) {
      const float* row = first + static_cast<std::ptrdiff_t>(x) * window.strideX() +
                         static_cast<std::ptrdiff_t>(y) * window.strideY();
      sum_x += weights[1][y] * (weights[2][0] * row[0] + weights[2][1] * row[1] +
                                weights[2][2] * row[2] + weights[2][3] * row[3]);
    }
    sum += weights[0][x] * sum_x;
  }
  return sum;
}

}  // namespace vdbdither
