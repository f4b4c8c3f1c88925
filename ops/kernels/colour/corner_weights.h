#pragma once

#include <array>
#include <cstddef>

#include <openvdb/Types.h>

#include "ops/kernels/mesh/closest_point.h"

namespace vdbdither {

/// The shares of the corners of a triangle in a point of it; they sum to 1.
using CornerWeights = std::array<double, 3>;

/// Returns those of a point of the triangle a, b, c.
CornerWeights weightsOf(const openvdb::Vec3d& a, const openvdb::Vec3d& b, const openvdb::Vec3d& c,
                        const PointOnTriangle& at);

/// Returns the mean of what the corners have: exactly the same if all have the same.
template <class Vector>
Vector mixed(const std::array<Vector, 3>& corners, const CornerWeights& weights) {
  return corners[0] + (corners[1] - corners[0]) * static_cast<float>(weights[1]) +
         (corners[2] - corners[0]) * static_cast<float>(weights[2]);
}

}  // namespace vdbdither
