#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

#include <openvdb/openvdb.h>

#include "vdbdither/model/lattice.h"

namespace vdbdither {

/// The values of the voxels of one leaf of a float tree and of those up to `halo` around it, in one
/// block of memory, whether they are active or not.
class LeafWindow {
 public:
  /// Layers outside `valid` hold the background.
  LeafWindow(const openvdb::FloatTree& tree, const openvdb::Coord& halo, ZRange valid)
      : tree_(tree),
        background_(tree.background()),
        halo_(halo),
        size_(openvdb::Coord(leaf_layers) + halo + halo),
        valid_(valid),
        values_(static_cast<std::size_t>(size_.x()) * static_cast<std::size_t>(size_.y()) *
                static_cast<std::size_t>(size_.z())) {}

  /// Reads the surroundings of the leaf at `origin`.
  void visit(const openvdb::Coord& origin) {
    const openvdb::Coord low = origin - halo_;
    const openvdb::Coord high = low + size_.offsetBy(-1);
    std::fill(values_.begin(), values_.end(), background_);
    for (int x = low.x() & ~7; x <= high.x(); x += leaf_layers)
      for (int y = low.y() & ~7; y <= high.y(); y += leaf_layers)
        for (int z = low.z() & ~7; z <= high.z(); z += leaf_layers) copy({x, y, z}, low, high);
  }

  /// Returns where the value of a voxel lies, by its indices from the leaf's origin on. That of the
  /// next voxel along z follows.
  [[nodiscard]] const float* at(int x, int y, int z) const {
    return &values_[static_cast<std::size_t>(
        ((x + halo_.x()) * size_.y() + y + halo_.y()) * size_.z() + z + halo_.z())];
  }
  [[nodiscard]] int strideX() const { return size_.y() * size_.z(); }
  [[nodiscard]] int strideY() const { return size_.z(); }

 private:
  /// Copies what the block shares with the leaf, or tile, at `from`.
  void copy(const openvdb::Coord& from, const openvdb::Coord& low, const openvdb::Coord& high) {
    const auto* leaf = tree_.probeConstLeaf(from);
    const float tile = leaf ? 0 : tree_.getValue(from);
    if (!leaf && tile == background_) return;
    const int z_begin = std::max({from.z(), low.z(), valid_.begin});
    const int z_end = std::min({from.z() + leaf_layers, high.z() + 1, valid_.end});
    if (z_begin >= z_end) return;
    for (int x = std::max(from.x(), low.x()); x <= std::min(from.x() + 7, high.x()); ++x) {
      for (int y = std::max(from.y(), low.y()); y <= std::min(from.y() + 7, high.y()); ++y) {
        float* out = &values_[static_cast<std::size_t>(
            ((x - low.x()) * size_.y() + y - low.y()) * size_.z() + z_begin - low.z())];
        if (leaf) {
          const float* in =
              leaf->buffer().data() + 64 * (x - from.x()) + 8 * (y - from.y()) - from.z();
          std::copy(in + z_begin, in + z_end, out);
        } else {
          std::fill(out, out + (z_end - z_begin), tile);
        }
      }
    }
  }

  openvdb::tree::ValueAccessor<const openvdb::FloatTree, false> tree_;
  float background_;
  openvdb::Coord halo_;
  openvdb::Coord size_;
  ZRange valid_;
  std::vector<float> values_;
};

}  // namespace vdbdither
