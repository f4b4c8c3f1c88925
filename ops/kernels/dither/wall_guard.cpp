#include "ops/kernels/dither/wall_guard.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <tuple>

#include "ops/kernels/leaf/floats.h"

namespace vdbdither {

using openvdb::Coord;

namespace {

/// A surface of a smaller radius does not count as a single sheet; its edges and wires do not
/// change.
constexpr double minimum_radius_mm = 0.3;

inline Floats clamped(Floats values, Floats bound) {
  return greaterOf(lesserOf(values, bound), -bound);
}

}  // namespace

bool WallGuard::allows(const LeafSurroundings& around, const Coord& origin, unsigned offset,
                       const openvdb::Vec3s& normal, float d_mm) {
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
    // Ignores components that are rounding errors of a flat facet's normal.
    if (rise_mm[axis] < 1e-3 * highest_mm) continue;
    outward[axis] = normal[axis] > 0 ? 1 : -1;
    rise_all_mm += rise_mm[axis];
  }

  const double half_diameter_mm = 0.5 / steepest_per_mm;
  const double depth_mm = std::abs(double{d_mm});
  const int own = d_mm < 0 ? -1 : 1;  // the side that the voxel lies on
  using At = LeafSurroundings;
  const float* here = around.at(offset);
  // The distance of a voxel from the surface, positive on the given side.
  const auto sample = [&](int side, const Coord& step) {
    const int farthest = std::max({std::abs(step.x()), std::abs(step.y()), std::abs(step.z())});
    const double d =
        farthest <= At::halo
            ? double{here[step.x() * At::stride_x + step.y() * At::stride_y + step.z()]}
            : distance(origin + FloatLeaf::offsetToLocalCoord(offset) + step);
    return std::clamp(side * d, -band_mm, band_mm);
  };

  // T on the voxel's own side, one step further in; then across the face, by the steps that are
  // needed to tell thick from thin.
  const int steps = 1 + static_cast<int>(1.5 * depth_mm / rise_all_mm + 0.95);
  const auto outward_by = [&](int n) {
    return Coord(n * outward.x(), n * outward.y(), n * outward.z());
  };
  if (sample(own, outward_by(own)) < half_diameter_mm) return false;
  const double beyond_mm = sample(-own, outward_by(-own * steps));
  if (beyond_mm <= -band_mm ||
      beyond_mm < 2 * depth_mm + half_diameter_mm - (steps - 1) * rise_all_mm)
    return false;

  // Three neighbours along z at a time; the fourth lane is idle.
  const auto [pitch_x, pitch_y, pitch_z] = std::tuple(pitch_mm_[0], pitch_mm_[1], pitch_mm_[2]);
  const Floats band = Floats{} + static_cast<float>(band_mm);
  const auto side = static_cast<float>(own);
  const auto depth = static_cast<float>(depth_mm);
  const auto half_diameter = static_cast<float>(half_diameter_mm);
  const auto rounding = static_cast<float>(0.02 * rise_all_mm);
  const auto per_radius = static_cast<float>(1 / (2 * minimum_radius_mm));
  const auto rise_z = static_cast<float>(double{normal[2]} * pitch_z);
  const auto along2 = static_cast<float>(pitch_z * pitch_z);
  const Floats rises_z{-rise_z, 0, rise_z, 0};
  const Floats squares_z{along2, 0, along2, 0};
  for (int i = -1; i <= 1; ++i) {
    for (int j = -1; j <= 1; ++j) {
      const auto across =
          static_cast<float>(double{normal[0]} * pitch_x * i + double{normal[1]} * pitch_y * j);
      const auto across2 =
          static_cast<float>(pitch_x * pitch_x * (i * i) + pitch_y * pitch_y * (j * j));
      const Floats rise = rises_z + across;
      const Floats flat = clamped(rise * side + depth, band);
      const Floats bend = (squares_z + across2 - rise * rise) * per_radius + rounding;
      const Floats there =
          clamped(loadFloats(here + i * At::stride_x + j * At::stride_y - 1) * side, band);
      const Floats nearer = lesserOf(flat, there);
      const FloatBits bent = (nearer < half_diameter) & (greaterOf(flat, there) - nearer > bend);
      if ((bent[0] | bent[1] | bent[2]) != 0) return false;
    }
  }
  return true;
}

double WallGuard::distance(const Coord& ijk) {
  constexpr double none = std::numeric_limits<double>::infinity();
  float value = 0;
  if (!valid_.contains(ijk.z())) return none;
  return surface_.probeValue(ijk, value) ? double{value} : std::copysign(none, double{value});
}

}  // namespace vdbdither
