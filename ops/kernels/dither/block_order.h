#pragma once

#include <openvdb/openvdb.h>

#include "vdbdither/model/lattice.h"

namespace vdbdither {

/// A fixed order in which voxels that depend on their neighbours are visited.
///
/// Space is divided into blocks of whole leaves at absolute indices, no smaller than the reach of
/// the dependence. Blocks have eight colours, by the parity of their indices along each axis.
/// Colours follow each other, and blocks of one colour do not depend on each other, so they can run
/// in parallel with the same result. The parity along z is the outermost: even layers of blocks are
/// complete before odd ones begin, so that a block depends on the layers of blocks next to it and
/// on no others.
class BlockOrder {
 public:
  static constexpr int colours = 8;

  /// Blocks have two leaves at least along x and y, where their size costs nothing: the fewer
  /// seams, the better the result.
  ///
  /// \param reach  in voxels along each axis
  explicit BlockOrder(const openvdb::Coord& reach);

  /// The index of the block that holds this voxel.
  [[nodiscard]] openvdb::Coord blockOf(const openvdb::Coord& ijk) const;

  /// The lowest voxel of the block that holds this voxel.
  [[nodiscard]] openvdb::Coord cornerOf(const openvdb::Coord& ijk) const;

  /// 0 … 7, in the order of visits.
  static int colourOf(const openvdb::Coord& block) {
    return ((block.z() & 1) << 2) | ((block.y() & 1) << 1) | (block.x() & 1);
  }

  /// The edges of a block, in voxels.
  [[nodiscard]] const openvdb::Coord& edges() const { return edges_; }

  /// Returns the layers of whole blocks on which `core` depends.
  ///
  /// \param sweeps  how often every voxel is visited
  [[nodiscard]] ZRange needed(ZRange core, int sweeps = 1) const;

  /// The maximum number of layers that `needed` adds on either side of a core of whole leaves.
  [[nodiscard]] int reachLayers(int sweeps = 1) const {
    return 2 * sweeps * edges_.z() - leaf_layers;
  }

 private:
  openvdb::Coord edges_;
};

}  // namespace vdbdither
