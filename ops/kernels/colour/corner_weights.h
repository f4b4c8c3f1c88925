#pragma once

#include <array>

#include "ops/kernels/mesh/closest_point.h"

namespace vdbdither {

/// Returns the mean of what the corners of a triangle have: exactly the same if all have the same.
template <class Vector>
Vector mixed(const std::array<Vector, 3>& corners, const CornerWeights& weights) {
  return corners[0] + (corners[1] - corners[0]) * static_cast<float>(weights[1]) +
         (corners[2] - corners[0]) * static_cast<float>(weights[2]);
}

}  // namespace vdbdither
