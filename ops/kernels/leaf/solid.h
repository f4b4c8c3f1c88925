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

/// The tiles of `surface` that lie inside (d < 0), cut to `layers`; those that stand on each other
/// are one box.
std::vector<openvdb::CoordBBox> insideTiles(const openvdb::FloatTree& surface, ZRange layers);

/// An empty grid `solid`: active and true inside, false outside.
openvdb::BoolGrid::Ptr makeSolidGrid(const openvdb::math::Transform& transform);

/// The grid `solid` of boxes filled whole and of leaves, which replace what the boxes filled there.
/// Canonical: its topology is as coarse as its values allow, whatever the topology it came from.
openvdb::BoolGrid::Ptr makeSolidGrid(const openvdb::math::Transform& transform,
                                     std::span<const SolidLeaf> leaves,
                                     std::span<const openvdb::CoordBBox> boxes);

}  // namespace vdbdither
