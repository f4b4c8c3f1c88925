#include "ops/kernels/mesh/line_winding.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "ops/kernels/mesh/winding_number.h"

namespace vdbdither {

using openvdb::Vec3d;

/// A line along an axis through a place, which it leaves out up to `beside_` on both sides.
class LineWinding::Line {
 public:
  Line(const Vec3d& p, const Vec3d& normal, double beside_mm) : p_(p) {
    for (int axis = 1; axis < 3; ++axis)
      if (std::abs(normal[axis]) > std::abs(normal[axis_])) axis_ = axis;
    u_ = (axis_ + 1) % 3;
    v_ = (axis_ + 2) % 3;
    beside_ = beside_mm / std::abs(normal[axis_]);
    is_upwards_ = normal[axis_] > 0;
  }

  /// Whether the line passes a box that does not end below the place.
  [[nodiscard]] bool passes(const BoxTree::Box& box) const {
    return box.min()[u_] <= p_[u_] && p_[u_] <= box.max()[u_] && box.min()[v_] <= p_[v_] &&
           p_[v_] <= box.max()[v_] && p_[axis_] - beside_ <= box.max()[axis_];
  }
  /// Whether a box holds the place, or a part of what is left out.
  [[nodiscard]] bool isIn(const BoxTree::Box& box) const {
    return passes(box) && box.min()[axis_] <= p_[axis_] + beside_;
  }

  /// Adds what a triangle above the place contributes to the numbers.
  void add(const std::array<Vec3d, 3>& at, Sides& sides) const {
    const int crossing = crossingOf(at);
    if (crossing == 0) return;
    const double height = heightOf(at);
    const bool is_above = height > beside_;
    const bool is_below = height > -beside_;
    sides.front += (is_upwards_ ? is_above : is_below) ? crossing : 0;
    sides.back += (is_upwards_ ? is_below : is_above) ? crossing : 0;
  }

 private:
  /// Returns 1 where the line passes a triangle whose corners turn counter-clockwise seen from the
  /// upper end of the axis, −1 where they turn clockwise, and otherwise 0. A side counts where it
  /// lies beyond the line along u, and is computed from its lower end whichever way it is passed.
  [[nodiscard]] int crossingOf(const std::array<Vec3d, 3>& at) const {
    const double u = p_[u_];
    const double v = p_[v_];
    int crossing = 0;
    for (std::size_t side = 0; side < 3; ++side) {
      const Vec3d& a = at[side];
      const Vec3d& b = at[(side + 1) % 3];
      const bool upwards = a[v_] <= v;
      if (upwards == (b[v_] <= v)) continue;
      const Vec3d& low = upwards ? a : b;
      const Vec3d& high = upwards ? b : a;
      const double left =
          (high[u_] - low[u_]) * (v - low[v_]) - (high[v_] - low[v_]) * (u - low[u_]);
      if (left > 0) crossing += upwards ? 1 : -1;
    }
    return crossing;
  }

  /// Returns how far above the place the line passes the plane of a triangle.
  [[nodiscard]] double heightOf(const std::array<Vec3d, 3>& at) const {
    const Vec3d normal = (at[1] - at[0]).cross(at[2] - at[0]);
    const Vec3d to = at[0] - p_;
    return normal[axis_] == 0 ? to[axis_] : normal.dot(to) / normal[axis_];
  }

  Vec3d p_;
  int axis_ = 0, u_, v_;
  double beside_;  ///< along the line
  bool is_upwards_;
};

LineWinding::LineWinding(const Mesh& mesh, const MeshBodies& bodies,
                         const std::vector<BoxTree::Box>& boxes)
    : mesh_(mesh), body_boxes_(bodies.count()) {
  std::vector<std::vector<std::uint32_t>> members(bodies.count());
  for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t) {
    members[bodies.of(t)].push_back(t);
    body_boxes_[bodies.of(t)].expand(boxes[t]);
  }
  triangles_.reserve(members.size());
  for (std::vector<std::uint32_t>& of : members) triangles_.emplace_back(boxes, std::move(of));
  std::vector<std::uint32_t> all(members.size());
  std::iota(all.begin(), all.end(), 0U);
  bodies_ = BoxTree(body_boxes_, std::move(all));
}

LineWinding::Sides LineWinding::ofBody(std::uint32_t body, const Line& line) const {
  Sides sides;
  triangles_[body].visit([&](const BoxTree::Box& box) { return line.passes(box); },
                         [&](std::uint32_t triangle) {
                           line.add(cornersOf(mesh_, triangle), sides);
                           return true;
                         });
  return sides;
}

LineWinding::Sides LineWinding::at(const Vec3d& p, const Vec3d& normal, double beside_mm,
                                   std::span<const std::uint32_t> except) const {
  const Line line(p, normal, beside_mm);
  Sides sum;
  bodies_.visit([&](const BoxTree::Box& box) { return line.isIn(box); },
                [&](std::uint32_t body) {
                  if (!std::binary_search(except.begin(), except.end(), body))
                    sum += ofBody(body, line);
                  return true;
                });
  return sum;
}

LineWinding::Sides LineWinding::ofBody(std::uint32_t body, const Vec3d& p, const Vec3d& normal,
                                       double beside_mm) const {
  const Line line(p, normal, beside_mm);
  return line.isIn(body_boxes_[body]) ? ofBody(body, line) : Sides();
}

}  // namespace vdbdither
