#pragma once

#include <cmath>

#include <openvdb/Types.h>

namespace vdbdither {

/// |d| of a voxel whose centre lies on the surface, mm: the sign alone says on which side it
/// counts. The smallest number that half precision holds, so that `write --half` keeps the side.
inline constexpr float tied_mm = 0x1p-24F;

/// −d: the distance to the complement, to which belongs what lies on neither side.
inline float complemented(float d) { return d == 0 ? -tied_mm : -d; }

/// Whether a centre on a surface with this outward normal counts as inside: where the point shifted
/// by (ε, ε³, ε²) is. Components below a thousandth of the normal are rounding.
inline bool tieIsInside(const openvdb::Vec3d& outward) {
  const double least = 1e-3 * outward.length();
  for (const int axis : {0, 2, 1})
    if (std::abs(outward[axis]) > least) return outward[axis] < 0;
  return false;
}

}  // namespace vdbdither
