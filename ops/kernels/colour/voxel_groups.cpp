#include "ops/kernels/colour/voxel_groups.h"

#include <algorithm>

#include "vdbdither/model/openvdb.h"

namespace vdbdither {

using openvdb::Coord;
using openvdb::CoordBBox;
using openvdb::Vec3d;

VoxelGroups::VoxelGroups(const Vec3d& pitch_mm) {
  constexpr int most_bits = 3;
  constexpr int most_layers = 16;
  constexpr double rounding = 1e-9;
  const double half_mm =
      0.5 * (1 - rounding) * std::max({pitch_mm.x(), pitch_mm.y(), pitch_mm.z()});
  for (int x = 0; x <= most_bits; ++x)
    for (int y = 0; y <= most_bits; ++y)
      for (int z = 1; z <= most_layers; ++z) {
        const double off_mm = (Vec3d((1 << x) - 1, (1 << y) - 1, z - 1) * 0.5 * pitch_mm).length();
        const bool is_larger = (z << (x + y)) > (layers_ << (x_bits_ + y_bits_));
        if (off_mm >= half_mm || !is_larger) continue;
        x_bits_ = x;
        y_bits_ = y;
        layers_ = z;
        off_mm_ = off_mm;
      }
}

CoordBBox VoxelGroups::voxelsOf(const CoordBBox& groups) const {
  const Coord edges = size();
  CoordBBox voxels;
  for (int axis = 0; axis < 3; ++axis) {
    voxels.min()[axis] = groups.min()[axis] * edges[axis];
    voxels.max()[axis] = groups.max()[axis] * edges[axis] + edges[axis] - 1;
  }
  return voxels;
}

Lattice VoxelGroups::middlesOf(const Lattice& voxels) const {
  const Vec3d edges = size().asVec3d();
  const auto group_of = [&](const Coord& ijk) {
    return Coord(xOf(ijk.x()), yOf(ijk.y()), zOf(ijk.z()));
  };
  return {voxels.pitch_mm * edges,
          voxels.origin_mm + 0.5 * (edges - Vec3d(1.0)) * voxels.pitch_mm,
          {group_of(voxels.box.min()), group_of(voxels.box.max())}};
}

}  // namespace vdbdither
