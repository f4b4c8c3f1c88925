#include "ops/kernels/colour/corner_weights.h"

#include <algorithm>

namespace vdbdither {

using openvdb::Vec3d;

CornerWeights weightsOf(const Vec3d& a, const Vec3d& b, const Vec3d& c, const PointOnTriangle& at) {
  CornerWeights weights{};
  if (const auto corner = at.corner()) {
    weights[*corner] = 1;
    return weights;
  }
  if (const auto side = at.side()) {
    const std::array<Vec3d, 3> corners{a, b, c};
    const std::size_t next = (*side + 1) % 3;
    const Vec3d along = corners[next] - corners[*side];
    weights[next] = std::clamp(along.dot(at.point - corners[*side]) / along.lengthSqr(), 0.0, 1.0);
    weights[*side] = 1 - weights[next];
    return weights;
  }
  const Vec3d normal = (b - a).cross(c - a);
  const double whole = normal.lengthSqr();
  if (!(whole > 0)) return {1, 0, 0};
  weights[1] = std::clamp((at.point - a).cross(c - a).dot(normal) / whole, 0.0, 1.0);
  weights[2] = std::clamp((b - a).cross(at.point - a).dot(normal) / whole, 0.0, 1.0);
  weights[0] = std::max(0.0, 1 - weights[1] - weights[2]);
  return weights;
}

}  // namespace vdbdither
