#include "ops/kernels/wall_guard.h"

#include <algorithm>
#include <cmath>

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
  const int own = d_mm < 0 ? -1 : 1;  // the side that the voxel lies on
  const auto sample = [&](int side, int i, int j, int k) {
    return std::clamp(distance(ijk.offsetBy(i, j, k), side, band_mm), -band_mm, band_mm);
  };

  // T on its own side, one step further in, then across the face, as many steps as it takes to tell
  // thick from thin.
  const int steps = 1 + static_cast<int>(1.5 * depth_mm / rise_all_mm + 0.95);
  if (sample(own, own * outward.x(), own * outward.y(), own * outward.z()) < half_diameter_mm)
    return false;
  const int across = -own * steps;
  const double beyond_mm =
      sample(-own, across * outward.x(), across * outward.y(), across * outward.z());
  if (beyond_mm <= -band_mm ||
      beyond_mm < 2 * depth_mm + half_diameter_mm - (steps - 1) * rise_all_mm)
    return false;

  for (int i = -1; i <= 1; ++i) {
    for (int j = -1; j <= 1; ++j) {
      for (int k = -1; k <= 1; ++k) {
        const openvdb::Vec3d to(pitch_mm_[0] * i, pitch_mm_[1] * j, pitch_mm_[2] * k);
        const double rise = openvdb::Vec3d(normal).dot(to);
        const double flat_mm = std::clamp(depth_mm + own * rise, -band_mm, band_mm);
        const double bend_mm = (to.lengthSqr() - rise * rise) / (2 * least_radius_mm);
        const double there_mm = sample(own, i, j, k);
        if (std::min(flat_mm, there_mm) < half_diameter_mm &&
            std::abs(flat_mm - there_mm) > bend_mm + 0.02 * rise_all_mm)
          return false;
      }
    }
  }
  return true;
}

double WallGuard::distance(const Coord& ijk, int side, double band_mm) {
  float value = static_cast<float>(background_mm_);
  const bool active = valid_.contains(ijk.z()) && surface_.probeValue(ijk, value);
  const double distance_mm = side * double{value};
  return active ? distance_mm : std::copysign(band_mm, distance_mm);
}

}  // namespace vdbdither
