#include "ops/kernels/wall_guard.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace vdbdither {

using openvdb::Coord;

namespace {

/// A surface that bends more is not one sheet to a voxel: its edges and wires stay as they are.
constexpr double least_radius_mm = 0.3;

}  // namespace

bool WallGuard::allows(const Coord& ijk, const openvdb::Vec3s& normal, float d_mm) {
  openvdb::Vec3d rise_mm;
  double steepest_per_mm = 0;
  for (int axis = 0; axis < 3; ++axis) {
    rise_mm[axis] = std::abs(double{normal[axis]}) * pitch_mm_[axis];
    steepest_per_mm = std::max(steepest_per_mm, std::abs(double{normal[axis]}) / pitch_mm_[axis]);
  }
  const double highest_mm = std::max({rise_mm[0], rise_mm[1], rise_mm[2]});
  if (highest_mm == 0) return false;
  const double band_mm = std::min(std::max(highest_mm, 1 / steepest_per_mm), background_mm_);

  Coord outward(0);
  double rise_all_mm = 0;
  for (int axis = 0; axis < 3; ++axis) {
    // What a flat facet's normal has of rounding errors is no direction.
    if (rise_mm[axis] < 1e-3 * highest_mm) continue;
    outward[axis] = normal[axis] > 0 ? 1 : -1;
    rise_all_mm += rise_mm[axis];
  }

  const double half_diameter_mm = 0.5 / steepest_per_mm;
  const double depth_mm = std::abs(double{d_mm});
  const int away = d_mm < 0 ? 1 : -1;  // from the side that the voxel lies on
  // The sheet: no neighbour that might be overturned, or has been decided, where the face is not.
  for (int i = -1; i <= 1; ++i) {
    for (int j = -1; j <= 1; ++j) {
      for (int k = -1; k <= 1; ++k) {
        const openvdb::Vec3d to(pitch_mm_[0] * i, pitch_mm_[1] * j, pitch_mm_[2] * k);
        const double rise = openvdb::Vec3d(normal).dot(to);
        const double expected_mm = depth_mm - away * rise;
        const double bend_mm = (to.lengthSqr() - rise * rise) / (2 * least_radius_mm);
        // Beyond the band on the other side, where it mostly should be: at least so far.
        const double there_mm = std::max(depth(ijk.offsetBy(i, j, k), -away, band_mm), -band_mm);
        if (there_mm < half_diameter_mm && expected_mm - there_mm > bend_mm + 0.02 * rise_all_mm)
          return false;
      }
    }
  }
  const Coord own(ijk.x() - away * outward.x(), ijk.y() - away * outward.y(),
                  ijk.z() - away * outward.z());
  if (depth(own, -away, band_mm) < depth_mm) return false;
  // On the other side, as many steps as it takes to tell thick from thin.
  const int steps = 1 + static_cast<int>(2 * depth_mm / rise_all_mm + 0.8);
  const Coord across(ijk.x() + away * steps * outward.x(), ijk.y() + away * steps * outward.y(),
                     ijk.z() + away * steps * outward.z());
  return depth(across, away, band_mm) >= 3 * depth_mm - (steps - 1) * rise_all_mm;
}

double WallGuard::depth(const Coord& ijk, int side, double band_mm) {
  float value = static_cast<float>(background_mm_);
  const bool active = valid_.contains(ijk.z()) && surface_.probeValue(ijk, value);
  const double depth_mm = side * double{value};
  if (active) return depth_mm;
  return depth_mm < 0 ? -std::numeric_limits<double>::infinity() : band_mm;
}

}  // namespace vdbdither
