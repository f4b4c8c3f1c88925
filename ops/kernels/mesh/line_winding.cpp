#include "ops/kernels/mesh/line_winding.h"

#include <cmath>
#include <numeric>
#include <utility>

#include "ops/kernels/leaf/disjoint_sets.h"
#include "ops/kernels/mesh/winding_number.h"

namespace vdbdither {

using openvdb::Vec3d;

namespace {

/// A line along an axis.
struct Line {
  int axis, u, v;
  Vec3d p;

  /// Whether the line passes a box that does not end below `low`.
  [[nodiscard]] bool passes(const BoxTree::Box& box, double low) const {
    return box.min()[u] <= p[u] && p[u] <= box.max()[u] && box.min()[v] <= p[v] &&
           p[v] <= box.max()[v] && low <= box.max()[axis];
  }
};

/// Returns 1 where the line passes a triangle whose corners turn counter-clockwise seen from the
/// upper end of the axis, −1 where they turn clockwise, and otherwise 0. A side counts where it
/// lies beyond the line along u, and is computed from its lower end whichever way it is passed.
int crossingOf(const std::array<Vec3d, 3>& at, const Line& line) {
  const double u = line.p[line.u];
  const double v = line.p[line.v];
  int crossing = 0;
  for (std::size_t side = 0; side < 3; ++side) {
    const Vec3d& a = at[side];
    const Vec3d& b = at[(side + 1) % 3];
    const bool upwards = a[line.v] <= v;
    if (upwards == (b[line.v] <= v)) continue;
    const Vec3d& low = upwards ? a : b;
    const Vec3d& high = upwards ? b : a;
    const double left = (high[line.u] - low[line.u]) * (v - low[line.v]) -
                        (high[line.v] - low[line.v]) * (u - low[line.u]);
    if (left > 0) crossing += upwards ? 1 : -1;
  }
  return crossing;
}

/// Returns how far above p the line passes the plane of a triangle.
double heightOf(const std::array<Vec3d, 3>& at, const Line& line) {
  const Vec3d normal = (at[1] - at[0]).cross(at[2] - at[0]);
  const Vec3d to = at[0] - line.p;
  return normal[line.axis] == 0 ? to[line.axis] : normal.dot(to) / normal[line.axis];
}

}  // namespace

LineWinding::LineWinding(const Mesh& mesh, const MeshEdges& edges,
                         const std::vector<BoxTree::Box>& boxes)
    : mesh_(mesh) {
  const auto count = static_cast<std::uint32_t>(mesh.triangles.size());
  DisjointSets bodies(count);
  for (std::uint32_t e = 0; e < edges.size(); ++e)
    for (const std::uint32_t half : edges.halves(e)) bodies.join(edges.halves(e)[0] / 3, half / 3);
  std::vector<std::uint32_t> place(count);
  std::vector<std::vector<std::uint32_t>> members;
  for (std::uint32_t t = 0; t < count; ++t) {
    const std::uint32_t body = bodies.find(t);
    if (body == t) {
      place[t] = static_cast<std::uint32_t>(members.size());
      members.emplace_back();
      body_boxes_.emplace_back();
    }
    members[place[body]].push_back(t);
    body_boxes_[place[body]].expand(boxes[t]);
  }
  triangles_.reserve(members.size());
  for (std::vector<std::uint32_t>& of : members) triangles_.emplace_back(boxes, std::move(of));
  std::vector<std::uint32_t> all(members.size());
  std::iota(all.begin(), all.end(), 0U);
  bodies_ = BoxTree(body_boxes_, std::move(all));
}

LineWinding::Sides LineWinding::at(const Vec3d& p, const Vec3d& normal, double beside_mm) const {
  Line line{0, 0, 0, p};
  for (int axis = 1; axis < 3; ++axis)
    if (std::abs(normal[axis]) > std::abs(normal[line.axis])) line.axis = axis;
  line.u = (line.axis + 1) % 3;
  line.v = (line.axis + 2) % 3;
  const double beside = beside_mm / std::abs(normal[line.axis]);  // along the line
  const double low = p[line.axis] - beside;
  const double high = p[line.axis] + beside;
  int above = 0;
  int below = 0;
  const auto pass = [&](std::uint32_t triangle) {
    const std::array<Vec3d, 3> at = cornersOf(mesh_, triangle);
    const int crossing = crossingOf(at, line);
    if (crossing == 0) return true;
    const double height = heightOf(at, line);
    if (height > beside) above += crossing;
    if (height > -beside) below += crossing;
    return true;
  };
  bodies_.visit(
      [&](const BoxTree::Box& box) {
        return line.passes(box, low) && box.min()[line.axis] <= high;
      },
      [&](std::uint32_t body) {
        return triangles_[body].visit(
            [&](const BoxTree::Box& box) { return line.passes(box, low); }, pass);
      });
  return normal[line.axis] > 0 ? Sides{above, below} : Sides{below, above};
}

}  // namespace vdbdither
