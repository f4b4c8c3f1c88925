#include "ops/kernels/dither/voxel_normals.h"

#include <algorithm>
#include <cmath>

namespace vdbdither {

VoxelNormals::VoxelNormals(const openvdb::FloatTree& surface, const openvdb::Vec3d& pitch_mm,
                           const openvdb::Vec3STree* given, ZRange valid)
    : gradient_(surface, pitch_mm, valid), per_pitch_(openvdb::Vec3d(1.0) / pitch_mm) {
  if (given) given_.emplace(*given);
}

void VoxelNormals::visit(const FloatLeaf& leaf, const LeafBits& wanted) {
  leaf_ = &leaf;
  wanted_ = wanted;
  visited_ = false;
  rows_made_ = 0;
}

const LeafSurroundings& VoxelNormals::around() {
  if (!visited_) gradient_.visit(*leaf_, wanted_);
  visited_ = true;
  return gradient_.around();
}

LeafBits VoxelNormals::within(const LeafBits& undecided, double reach) {
  if (given_) return undecided;
  LeafBits near = no_bits;
  const auto limit = static_cast<float>(reach * (1 + 1e-5));
  for (unsigned row = 0; row < 64; ++row) {
    const auto bits = static_cast<std::uint8_t>(undecided[row / 8] >> (row % 8 * 8));
    if (bits == 0) continue;
    const LeafNormals::Row& normals = rowOf(row);
    const float* d = leaf_->buffer().data() + std::size_t{8} * row;
    std::array<float, 8> steepest{};  // 1 / (2·k_D)
    for (unsigned axis = 0; axis < 3; ++axis) {
      const std::array<float, 8>& normal = normals[axis];
      for (unsigned z = 0; z < 8; ++z) {
        const float steep = std::abs(normal[z]) * per_pitch_[axis];
        steepest[z] = steep > steepest[z] ? steep : steepest[z];
      }
    }
    std::array<float, 8> diameters;  // |d| / k_D
    for (unsigned z = 0; z < 8; ++z) diameters[z] = 2 * std::abs(d[z]) * steepest[z];
    near[row / 8] |=
        std::uint64_t{static_cast<std::uint8_t>(bits & rowBelow(diameters.data(), limit))}
        << (row % 8 * 8);
  }
  return near;
}

const LeafNormals::Row& VoxelNormals::rowOf(unsigned row) {
  const std::uint64_t bit = std::uint64_t{1} << row;
  if ((rows_made_ & bit) == 0) {
    rows_made_ |= bit;
    around();
    gradient_.makeRow(8 * row, rows_[row]);
  }
  return rows_[row];
}

}  // namespace vdbdither
