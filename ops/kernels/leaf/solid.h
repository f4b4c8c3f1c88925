#pragma once

#include <span>
#include <vector>

#include <openvdb/openvdb.h>

#include "ops/kernels/leaf/leaf_bits.h"
#include "vdbdither/model/lattice.h"

namespace vdbdither {

/// The printed voxels of one leaf.
struct SolidLeaf {
  openvdb::Coord origin;
  LeafBits inside;
};

/// Returns the tiles of `surface` that lie inside (d < 0), cut to `layers`; tiles on top of each
/// other become one box.
std::vector<openvdb::CoordBBox> insideTiles(const openvdb::FloatTree& surface, ZRange layers);

/// Returns an empty grid `solid`, in which voxels inside the part are active and true.
openvdb::BoolGrid::Ptr makeSolidGrid(const openvdb::math::Transform& transform);

/// Returns an empty grid `material`, in which 0 is empty.
openvdb::Int32Grid::Ptr makeMaterialGrid(const openvdb::math::Transform& transform);

/// Returns the grid `solid` of boxes, which are filled whole, and of leaves, which replace what the
/// boxes filled. The tree is canonical: its topology depends on the voxels alone.
openvdb::BoolGrid::Ptr makeSolidGrid(const openvdb::math::Transform& transform,
                                     std::span<const SolidLeaf> leaves,
                                     std::span<const openvdb::CoordBBox> boxes);

}  // namespace vdbdither
