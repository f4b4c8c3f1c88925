#pragma once

#include <array>
#include <deque>

#include <openvdb/openvdb.h>

#include "ops/kernels/leaf/leaf_bits.h"
#include "vdbdither/model/lattice.h"

namespace vdbdither {

/// The distances of the voxels of one leaf and of the two voxels around it on all sides, in one
/// block of memory.
///
/// Of an inactive voxel only the side is known: it holds +∞ outside the part and −∞ inside.
class LeafSurroundings {
 public:
  static constexpr int halo = 2;
  static constexpr int stride_z = 1;
  static constexpr int stride_y = 16;  // four voxels, a row of the leaf, four voxels
  static constexpr int stride_x = stride_y * (8 + 2 * halo);

  /// Layers outside `valid` are inactive and outside the part.
  LeafSurroundings(const openvdb::FloatTree& surface, ZRange valid)
      : surface_(surface), valid_(valid) {}

  /// Reads what is around the `wanted` voxels of `leaf`, a leaf of `surface`.
  void visit(const FloatLeaf& leaf, const LeafBits& wanted);

  /// Returns where the distance of the voxel at `offset` in the leaf lies. Those of its neighbours,
  /// up to `halo` away along each axis, lie at multiples of the strides; they are defined if the
  /// voxel is wanted.
  [[nodiscard]] const float* at(unsigned offset) const {
    const auto n = static_cast<int>(offset);
    return &values_[static_cast<std::size_t>(indexOf(n / 64, n / 8 % 8, n % 8))];
  }

 private:
  struct Block;

  static constexpr int indexOf(int x, int y, int z) {
    return (x + halo) * stride_x + (y + halo) * stride_y + z + 4;
  }
  Block blockAt(const openvdb::Coord& origin);

  alignas(64) std::array<float, static_cast<std::size_t>(stride_x) * (8 + 2 * halo)> values_{};
  openvdb::tree::ValueAccessor<const openvdb::FloatTree, false> surface_;
  ZRange valid_;
  std::deque<std::array<float, 512>> tiles_;  ///< active tiles around the leaf, expanded
};

}  // namespace vdbdither
