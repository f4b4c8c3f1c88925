#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include <openvdb/Types.h>

namespace vdbdither {

/// Returns x rounded up. The result must fit an int.
inline int roundedUp(double x) {
  const int towards_zero = static_cast<int>(x);
  return towards_zero + (towards_zero < x ? 1 : 0);
}

/// Returns x rounded down. The result must fit an int.
inline int roundedDown(double x) { return -roundedUp(-x); }

/// The rows of voxel centres along x that cross triangles.
///
/// A centre on the surface lies where the point shifted by (ε, ε³, ε²) lies: of an axis-parallel
/// box it belongs to the half-open intervals [min, max). "On the surface" allows for corners that
/// are off by up to `rounding_mm` along a normal. Each comparison allows for what the one before
/// may have moved: rounding_mm along y, twice that along z, four times that along x, all measured
/// perpendicular to the surface. No centre farther than tie_roundings times rounding_mm from the
/// surface changes sides.
class RowCrossings {
 public:
  static constexpr double tie_roundings = 8;

  /// Voxel centres lie at multiples of `pitch_mm`. `rounding_mm` is at most 1/32 of each.
  RowCrossings(const openvdb::Vec3d& pitch_mm, double rounding_mm)
      : pitch_mm_(pitch_mm), rounding_mm_(rounding_mm) {}

  /// Calls visit(ijk, delta) for every row that crosses the triangle: `ijk` is the first voxel at
  /// or beyond the crossing, and delta is +1 where the row enters the solid, −1 where it leaves it.
  ///
  /// A triangle is cut by planes of rows of constant y, of which it meets fewer than layers. The
  /// cut of a side is computed from the side alone, always from its lower end, so that the
  /// triangles which share the side agree to the bit: along every row the deltas of a closed mesh
  /// sum to zero, whatever the rounding.
  ///
  /// `corners` in mm, counter-clockwise seen from outside. Only rows of `box` are visited; a
  /// crossing before the box counts at the row's first voxel, one beyond the box is left out.
  template <class Visit>
  void visit(const std::array<openvdb::Vec3d, 3>& corners, const openvdb::CoordBBox& box,
             const Visit& visit) const;

 private:
  /// Where a plane of rows cuts a side.
  struct Cut {
    double x, z;
    int layer;       ///< the first above it
    double x_below;  ///< the side's x nearest to the row of `layer`, where that lies below z
  };

  [[nodiscard]] int firstAt(double position_mm, int axis, const openvdb::CoordBBox& box) const;
  [[nodiscard]] Cut cut(const openvdb::Vec3d& lower, const openvdb::Vec3d& upper, double y,
                        const openvdb::CoordBBox& box) const;
  [[nodiscard]] double toleranceAlongX(const std::array<openvdb::Vec3d, 3>& corners) const;

  openvdb::Vec3d pitch_mm_;
  double rounding_mm_;
};

/// The first index at or above a position, of those of `box` and the one after.
inline int RowCrossings::firstAt(double position_mm, int axis,
                                 const openvdb::CoordBBox& box) const {
  const double step_mm = pitch_mm_[axis];
  const int begin = box.min()[axis];
  const int end = box.max()[axis] + 1;
  const double near = position_mm / step_mm;
  if (!(near > begin - 1.0)) return begin;
  if (!(near < end + 1.0)) return end;
  int index = roundedUp(near);
  while ((index - 1) * step_mm >= position_mm) --index;
  while (index * step_mm < position_mm) ++index;
  return std::clamp(index, begin, end);
}

inline RowCrossings::Cut RowCrossings::cut(const openvdb::Vec3d& lower, const openvdb::Vec3d& upper,
                                           double y, const openvdb::CoordBBox& box) const {
  const openvdb::Vec3d side = upper - lower;
  // A corner may count as below the plane and lie above it.
  const double t = std::clamp((y - lower.y()) / side.y(), 0.0, 1.0);
  const double z = lower.z() + t * side.z();
  Cut cut{lower.x() + t * side.x(), z, firstAt(z, 2, box), 0};
  const double row_below_mm = (cut.layer - 1) * pitch_mm_.z();
  const double most_mm = pitch_mm_.z() / 8;
  if (cut.layer == box.min().z() || z - row_below_mm > most_mm) return cut;
  // The row below is a tie where it passes the side within the tolerance.
  const double squared = side.y() * side.y() + side.z() * side.z();
  const double tolerance_mm = 2 * rounding_mm_;
  if (z - row_below_mm > tolerance_mm * std::sqrt(squared) / side.y() ||
      row_below_mm < std::min(lower.z(), upper.z()) - tolerance_mm)
    return cut;
  --cut.layer;
  const double nearest = std::clamp(t + (row_below_mm - z) * side.z() / squared, 0.0, 1.0);
  cut.x_below = lower.x() + nearest * side.x();
  return cut;
}

/// How far a crossing may move along x while the centre stays within the tolerance of the plane.
inline double RowCrossings::toleranceAlongX(const std::array<openvdb::Vec3d, 3>& corners) const {
  const openvdb::Vec3d normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
  const double across = std::abs(normal.x());
  const double tolerance_mm = 4 * rounding_mm_;
  return across > 0 ? std::min(tolerance_mm * (normal.length() / across), pitch_mm_.x() / 4)
                    : tolerance_mm;
}

template <class Visit>
void RowCrossings::visit(const std::array<openvdb::Vec3d, 3>& corners,
                         const openvdb::CoordBBox& box, const Visit& visit) const {
  using openvdb::Vec3d;
  struct Corner {
    const Vec3d* at;
    int plane;
  };
  std::array<Corner, 3> sorted;
  for (std::size_t c = 0; c < 3; ++c)
    sorted[c] = {&corners[c], firstAt(corners[c].y() - rounding_mm_, 1, box)};
  bool upwards = false;  // the long side, from the lowest corner to the highest
  const auto order = [&](std::size_t a, std::size_t b) {
    if (sorted[b].plane >= sorted[a].plane) return;
    std::swap(sorted[a], sorted[b]);
    upwards = !upwards;
  };
  order(0, 1);
  order(1, 2);
  order(0, 1);

  double tolerance_mm = -1;
  for (int j = sorted[0].plane; j < sorted[2].plane; ++j) {
    const double y = j * pitch_mm_.y();
    const std::size_t part = j < sorted[1].plane ? 0 : 1;
    const Cut whole = cut(*sorted[0].at, *sorted[2].at, y, box);
    const Cut broken = cut(*sorted[part].at, *sorted[part + 1].at, y, box);
    const Cut& up = upwards ? whole : broken;
    const Cut& down = upwards ? broken : whole;
    if (up.layer == down.layer) continue;
    const int delta = up.layer < down.layer ? -1 : 1;
    const Cut& first = up.layer < down.layer ? up : down;
    const double slope = (down.x - up.x) / (down.z - up.z);
    const auto [x_low, x_high] = std::minmax({up.x, down.x});
    for (int k = first.layer; k < std::max(up.layer, down.layer); ++k) {
      const double z = k * pitch_mm_.z();
      const double x =
          z < first.z ? first.x_below : std::clamp(up.x + (z - up.z) * slope, x_low, x_high);
      const double crossing = x / pitch_mm_.x();
      if (!(crossing <= box.max().x() + 1.0)) continue;
      int i = roundedUp(std::max(crossing, static_cast<double>(box.min().x())));
      // The centre before the crossing may be a tie. Not beyond the triangle's end, where other
      // triangles go on.
      const double before_mm = (i - 1) * pitch_mm_.x();
      if (i > box.min().x() && x - before_mm <= pitch_mm_.x() / 4) {
        if (tolerance_mm < 0) tolerance_mm = toleranceAlongX(corners);
        const double limit_mm = std::max(x - tolerance_mm, std::min(x, x_low) - 4 * rounding_mm_);
        if (before_mm >= limit_mm) --i;
      }
      if (i <= box.max().x()) visit(openvdb::Coord(i, j, k), delta);
    }
  }
}

}  // namespace vdbdither
