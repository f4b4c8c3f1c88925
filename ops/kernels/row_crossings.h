#pragma once

#include <algorithm>
#include <array>
#include <cmath>

#include <openvdb/math/Coord.h>
#include <openvdb/math/Vec3.h>

namespace vdbdither {

/// Calls visit(ijk, delta) for every row of voxel centres along x that crosses the triangle: `ijk`
/// is the first voxel at or beyond the crossing, delta +1 where the row enters the solid and −1
/// where it leaves.
///
/// Where a layer cuts a side is computed from the side alone, always from its lower end, so that
/// the triangles which share it agree to the bit: along every row the deltas of a closed mesh sum
/// to zero, whatever the rounding.
///
/// `corners` in mm, counter-clockwise seen from outside; voxel centres lie at multiples of
/// `pitch_mm`. Only rows of `box` are visited; a crossing before the box counts at its first voxel,
/// one beyond it is left out.
template <class Visit>
void visitRowCrossings(const std::array<openvdb::Vec3d, 3>& corners, const openvdb::Vec3d& pitch_mm,
                       const openvdb::CoordBBox& box, const Visit& visit) {
  using openvdb::Vec3d;
  const auto [low, high] = std::minmax({corners[0].z(), corners[1].z(), corners[2].z()});
  const double first_layer =
      std::max(std::floor(low / pitch_mm.z()), static_cast<double>(box.min().z()));
  const double last_layer =
      std::min(std::ceil(high / pitch_mm.z()), static_cast<double>(box.max().z()));
  const auto firstRow = [&](double y) {
    return static_cast<int>(std::clamp(std::ceil(y / pitch_mm.y()),
                                       static_cast<double>(box.min().y()), box.max().y() + 1.0));
  };
  if (!(first_layer <= last_layer)) return;
  for (int k = static_cast<int>(first_layer); k <= static_cast<int>(last_layer); ++k) {
    const double z = k * pitch_mm.z();
    std::array<double, 2> x{},
        y{};  // of the side that goes up through the layer, and of the one that goes down
    bool cut = false;
    for (std::size_t side = 0; side < 3; ++side) {
      const Vec3d& from = corners[side];
      const Vec3d& to = corners[(side + 1) % 3];
      const bool up = from.z() <= z;
      if (up == (to.z() <= z)) continue;
      const Vec3d& lower = up ? from : to;
      const Vec3d& upper = up ? to : from;
      const double t = (z - lower.z()) / (upper.z() - lower.z());
      const std::size_t slot = up ? 0 : 1;
      x[slot] = lower.x() + t * (upper.x() - lower.x());
      y[slot] = lower.y() + t * (upper.y() - lower.y());
      cut = true;
    }
    if (!cut) continue;
    const int up_row = firstRow(y[0]);
    const int down_row = firstRow(y[1]);
    const int delta = up_row < down_row ? 1 : -1;
    const double along = y[1] - y[0];
    for (int j = std::min(up_row, down_row); j < std::max(up_row, down_row); ++j) {
      const double t = std::clamp((j * pitch_mm.y() - y[0]) / along, 0.0, 1.0);
      const double crossing = x[0] + t * (x[1] - x[0]);
      const double i =
          std::max(std::ceil(crossing / pitch_mm.x()), static_cast<double>(box.min().x()));
      if (i <= box.max().x()) visit(openvdb::Coord(static_cast<int>(i), j, k), delta);
    }
  }
}

}  // namespace vdbdither
