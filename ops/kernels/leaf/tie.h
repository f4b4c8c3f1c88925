#pragma once

#include <algorithm>
#include <array>
#include <cmath>

#include <openvdb/Types.h>

#include "ops/kernels/leaf/leaf_surroundings.h"

namespace vdbdither {

/// |d| of a voxel whose centre lies on the surface, mm: the sign alone says on which side it
/// counts. The smallest number that half precision holds, so that `write --half` keeps the side.
inline constexpr float tied_mm = 0x1p-24F;

/// The maximum distance that counts as a tie: of a part far from the origin, more would flatten
/// what the dither makes of the distances next to the surface.
inline double mostTieMm(const openvdb::Vec3d& pitch_mm) {
  return std::min({pitch_mm.x(), pitch_mm.y(), pitch_mm.z()}) / 32;
}

/// What is left after moving a surface by a length is a tie below this, mm.
inline constexpr double moved_tie_mm = 1e-6;

/// −d: the distance to the complement, to which belongs what lies on neither side.
inline float complemented(float d) { return d == 0 ? -tied_mm : -d; }

/// Whether a centre on a surface with this outward normal counts as inside: where the point shifted
/// by (ε, ε³, ε²) is. Components below a thousandth of the normal are rounding.
inline bool tieIsInside(const openvdb::Vec3d& outward) {
  const double minimum = 1e-3 * outward.length();
  for (const int axis : {0, 2, 1})
    if (std::abs(outward[axis]) > minimum) return outward[axis] < 0;
  return false;
}

/// Whether d falls (−1) or rises (+1) from a voxel to the point shifted by (ε, ε³, ε²), by its
/// neighbours; 0 where it does neither. `d`: its place in LeafSurroundings, of which one layer
/// above is needed.
inline int trendOfTie(const float* d, const openvdb::Vec3d& pitch_mm) {
  constexpr std::array<int, 3> strides{LeafSurroundings::stride_x, LeafSurroundings::stride_y,
                                       LeafSurroundings::stride_z};
  constexpr int end = -1;
  // The shorter ways serve where a whole step reaches the opposite face, on which d is zero again.
  constexpr std::array<std::array<int, 3>, 4> ways{
      {{0, 2, 1}, {0, 1, end}, {2, 1, end}, {1, end, end}}};
  const double here = double{*d};
  for (const std::array<int, 3>& way : ways) {
    const float* there = d;
    for (const int axis : way) {
      if (axis == end) break;
      there += strides[static_cast<std::size_t>(axis)];
      const double change = double{*there} - here;
      if (std::abs(change) > 1e-3 * pitch_mm[axis]) return change < 0 ? -1 : 1;
    }
  }
  return 0;
}

}  // namespace vdbdither
