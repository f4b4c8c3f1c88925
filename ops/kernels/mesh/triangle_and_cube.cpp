// Akenine-Möller: "Fast 3D triangle-box overlap testing", Journal of Graphics Tools 6(1), 2001.

#include "ops/kernels/mesh/triangle_and_cube.h"

#include <algorithm>
#include <cmath>

namespace vdbdither {

using openvdb::Vec3d;

/// They meet if no axis separates them: one of the cube's, the triangle's normal, or the cross
/// product of a side and a cube's axis.
bool meetsCube(const std::array<Vec3d, 3>& triangle, const Vec3d& middle, double half) {
  half *= 1 + 1e-6;
  const std::array<Vec3d, 3> at{triangle[0] - middle, triangle[1] - middle, triangle[2] - middle};
  for (int axis = 0; axis < 3; ++axis) {
    const auto [low, high] = std::minmax({at[0][axis], at[1][axis], at[2][axis]});
    if (low > half || high < -half) return false;
  }
  const Vec3d normal = (at[1] - at[0]).cross(at[2] - at[0]);
  if (std::abs(normal.dot(at[0])) >
      half * (std::abs(normal.x()) + std::abs(normal.y()) + std::abs(normal.z())))
    return false;
  for (std::size_t side = 0; side < 3; ++side) {
    const Vec3d along = at[(side + 1) % 3] - at[side];
    for (int axis = 0; axis < 3; ++axis) {
      const int u = (axis + 1) % 3;
      const int v = (axis + 2) % 3;
      const double one = along[u] * at[side][v] - along[v] * at[side][u];
      const Vec3d& opposite = at[(side + 2) % 3];
      const double other = along[u] * opposite[v] - along[v] * opposite[u];
      const double reach = half * (std::abs(along[u]) + std::abs(along[v]));
      if (std::min(one, other) > reach || std::max(one, other) < -reach) return false;
    }
  }
  return true;
}

}  // namespace vdbdither
