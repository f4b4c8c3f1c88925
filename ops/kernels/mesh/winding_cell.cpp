#include "ops/kernels/mesh/winding_cell.h"

#include <cmath>

#include "ops/kernels/mesh/triangle_and_cube.h"

namespace vdbdither {

using openvdb::Vec3d;

namespace {

/// Triangles within this many edges of the cube count one by one.
constexpr double near_edges = 1.5;

}  // namespace

WindingCell::WindingCell(const Mesh& mesh, const WindingNumber& winding, const Vec3d& low,
                         double edge_mm, const std::array<Corner, 8>& corners)
    : middle_(low + 0.5 * edge_mm), half_mm_(0.5 * edge_mm), far_(corners) {
  const double around_mm = (0.5 + near_edges) * edge_mm;
  winding.forEachWithin(middle_, std::sqrt(3.0) * around_mm, [&](std::uint32_t triangle) {
    if (meetsCube(cornersOf(mesh, triangle), middle_, around_mm)) near_.push_back(triangle);
  });
  for (int corner = 0; corner < 8; ++corner) {
    const Vec3d p = low + edge_mm * Vec3d(corner & 1, corner >> 1 & 1, corner >> 2 & 1);
    Corner& far = far_[static_cast<std::size_t>(corner)];
    far.number -= windingOf(mesh, near_, p);
    far.gradient -= windingGradientOf(mesh, near_, p);
  }
}

double WindingCell::at(const Mesh& mesh, const Vec3d& p) const {
  const Vec3d x = placed(p);
  double sum = 0;
  for (unsigned corner = 0; corner < 8; ++corner) {
    const Vec3d side((corner & 1) != 0 ? 1 : -1, (corner & 2) != 0 ? 1 : -1,
                     (corner & 4) != 0 ? 1 : -1);
    const Vec3d along = x * side;
    const double weight = (1 + along.x()) * (1 + along.y()) * (1 + along.z()) / 16;
    const Vec3d rises = side * (along * along - 1.0);
    sum += weight * (far_[corner].number * (2 + along.x() + along.y() + along.z() - x.dot(x)) +
                     half_mm_ * far_[corner].gradient.dot(rises));
  }
  return sum + windingOf(mesh, near_, p);
}

Vec3d WindingCell::gradientAt(const Mesh& mesh, const Vec3d& p) const {
  const Vec3d x = placed(p);
  Vec3d sum(0.0);
  for (unsigned corner = 0; corner < 8; ++corner)
    sum += far_[corner].gradient * ((1 + ((corner & 1) != 0 ? x.x() : -x.x())) *
                                    (1 + ((corner & 2) != 0 ? x.y() : -x.y())) *
                                    (1 + ((corner & 4) != 0 ? x.z() : -x.z())) / 8);
  return sum + windingGradientOf(mesh, near_, p);
}

}  // namespace vdbdither
