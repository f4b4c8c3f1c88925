#pragma once

#include <algorithm>
#include <array>
#include <utility>

#include <openvdb/math/Coord.h>
#include <openvdb/math/Vec3.h>

namespace vdbdither {

/// The least whole number not below x, which an int holds.
inline int roundedUp(double x) {
  const int towards_zero = static_cast<int>(x);
  return towards_zero + (towards_zero < x ? 1 : 0);
}

/// The greatest whole number not above x, which an int holds.
inline int roundedDown(double x) { return -roundedUp(-x); }

/// Calls visit(ijk, delta) for every row of voxel centres along x that crosses the triangle: `ijk`
/// is the first voxel at or beyond the crossing, delta +1 where the row enters the solid and −1
/// where it leaves.
///
/// Where a plane of rows (of constant y, of which a triangle meets fewer than layers) cuts a side
/// is computed from the side alone, always from its lower end, so that the triangles which share it
/// agree to the bit: along every row the deltas of a closed mesh sum to zero, whatever the
/// rounding.
///
/// `corners` in mm, counter-clockwise seen from outside; voxel centres lie at multiples of
/// `pitch_mm`. Only rows of `box` are visited; a crossing before the box counts at its first voxel,
/// one beyond it is left out.
template <class Visit>
void visitRowCrossings(const std::array<openvdb::Vec3d, 3>& corners, const openvdb::Vec3d& pitch_mm,
                       const openvdb::CoordBBox& box, const Visit& visit) {
  using openvdb::Vec3d;
  /// The first index at or above a position, of those visited and the one after.
  const auto firstAt = [&](double position_mm, int axis) {
    const double step_mm = pitch_mm[axis];
    const int begin = box.min()[axis];
    const int end = box.max()[axis] + 1;
    const double near = position_mm / step_mm;
    if (!(near > begin - 1.0)) return begin;
    if (!(near < end + 1.0)) return end;
    int index = roundedUp(near);
    while ((index - 1) * step_mm >= position_mm) --index;
    while (index * step_mm < position_mm) ++index;
    return std::clamp(index, begin, end);
  };
  struct Corner {
    const Vec3d* at;
    int plane;
  };
  std::array<Corner, 3> sorted;
  for (std::size_t c = 0; c < 3; ++c) sorted[c] = {&corners[c], firstAt(corners[c].y(), 1)};
  bool upwards = false;  // the long side, from the lowest corner to the highest
  const auto order = [&](std::size_t a, std::size_t b) {
    if (sorted[b].plane >= sorted[a].plane) return;
    std::swap(sorted[a], sorted[b]);
    upwards = !upwards;
  };
  order(0, 1);
  order(1, 2);
  order(0, 1);

  struct Cut {
    double x, z;
  };
  const auto cut = [](const Vec3d& lower, const Vec3d& upper, double y) {
    const double t = (y - lower.y()) / (upper.y() - lower.y());
    return Cut{lower.x() + t * (upper.x() - lower.x()), lower.z() + t * (upper.z() - lower.z())};
  };
  for (int j = sorted[0].plane; j < sorted[2].plane; ++j) {
    const double y = j * pitch_mm.y();
    const std::size_t part = j < sorted[1].plane ? 0 : 1;
    const Cut whole = cut(*sorted[0].at, *sorted[2].at, y);
    const Cut broken = cut(*sorted[part].at, *sorted[part + 1].at, y);
    const Cut& up = upwards ? whole : broken;
    const Cut& down = upwards ? broken : whole;
    const int up_layer = firstAt(up.z, 2);
    const int down_layer = firstAt(down.z, 2);
    const int delta = up_layer < down_layer ? -1 : 1;
    const double slope = (down.x - up.x) / (down.z - up.z);
    const auto [x_low, x_high] = std::minmax({up.x, down.x});
    for (int k = std::min(up_layer, down_layer); k < std::max(up_layer, down_layer); ++k) {
      const double x = std::clamp(up.x + (k * pitch_mm.z() - up.z) * slope, x_low, x_high);
      const double crossing = x / pitch_mm.x();
      if (!(crossing <= box.max().x())) continue;
      const int i = roundedUp(std::max(crossing, static_cast<double>(box.min().x())));
      visit(openvdb::Coord(i, j, k), delta);
    }
  }
}

}  // namespace vdbdither
