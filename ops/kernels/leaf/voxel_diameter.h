#pragma once

#include <algorithm>
#include <cmath>

#include <openvdb/math/Vec3.h>

namespace vdbdither {

/// Returns k_D(n) = 1 / (2·‖D n‖∞), the distance in mm from a voxel's centre to its boundary along
/// the unit normal `n`: half the voxel's diameter in this direction (Morsy, Brunton, Urban 2022,
/// eq. 6). Zero for the zero vector.
template <typename T>
double halfVoxelDiameter(const openvdb::math::Vec3<T>& n, const openvdb::Vec3d& pitch_mm) {
  const double steepest = std::max(
      {std::abs(n[0]) / pitch_mm[0], std::abs(n[1]) / pitch_mm[1], std::abs(n[2]) / pitch_mm[2]});
  return steepest > 0.0 ? 0.5 / steepest : 0.0;
}

/// Returns the largest k_D of any direction: half the voxel's diagonal.
inline double largestHalfVoxelDiameter(const openvdb::Vec3d& pitch_mm) {
  return 0.5 * pitch_mm.length();
}

}  // namespace vdbdither
