#pragma once

#include <algorithm>
#include <array>
#include <cmath>

#include <openvdb/math/Vec3.h>

namespace vdbdither {

/// Returns the share of a voxel, a full box, that lies below a plane: 1 where the whole voxel does.
/// \param d_mm  the distance of the voxel's centre above the plane
/// \param normal  the unit normal of the plane
inline double halfSpaceShare(double d_mm, const openvdb::Vec3d& normal,
                             const openvdb::Vec3d& pitch_mm) {
  // The box convolved along the normal is that of three segments. Very short ones count as longer,
  // since the formula divides by their lengths.
  std::array<double, 3> rise{};
  for (int axis = 0; axis < 3; ++axis)
    rise[static_cast<std::size_t>(axis)] = std::abs(normal[axis]) * pitch_mm[axis];
  const double highest = std::max({rise[0], rise[1], rise[2]});
  if (highest == 0) return d_mm < 0 ? 1 : 0;
  for (double& one : rise) one = std::max(one, 0.01 * highest);
  const double height = rise[0] + rise[1] + rise[2];
  const double above = height / 2 - std::abs(d_mm);
  if (above <= 0) return d_mm < 0 ? 1 : 0;
  const auto cube = [](double x) { return x > 0 ? x * x * x : 0; };
  const double corners = cube(above) - cube(above - rise[0]) - cube(above - rise[1]) -
                         cube(above - rise[2]) + cube(above - rise[0] - rise[1]) +
                         cube(above - rise[0] - rise[2]) + cube(above - rise[1] - rise[2]);
  const double share = corners / (6 * rise[0] * rise[1] * rise[2]);
  return d_mm < 0 ? 1 - share : share;
}

}  // namespace vdbdither
