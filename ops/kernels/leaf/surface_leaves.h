#pragma once

#include <array>
#include <memory>
#include <span>
#include <vector>

#include <openvdb/openvdb.h>

#include "ops/kernels/leaf/leaf_bits.h"
#include "vdbdither/model/lattice.h"

namespace vdbdither {

/// The distances of a leaf's voxels while they are changed, in the leaf's order. Of inactive voxels
/// only the sign counts.
struct LeafValues {
  std::array<float, 512> distance;
  LeafBits active{};

  /// The values of `surface` at `origin`, whether there is a leaf or a tile.
  static LeafValues of(const openvdb::tree::ValueAccessor<const openvdb::FloatTree, false>& surface,
                       const openvdb::Coord& origin);
};

/// Returns a level set made of `inside`, which is filled first, and of leaves at `origins`, limited
/// to the layers of `core`. Voxels are active where they are active in `leaves` and nearer than
/// `background_mm`, and hold ±background elsewhere. Name, transform and metadata are those of
/// `prototype`. The tree is canonical.
openvdb::FloatGrid::Ptr surfaceOf(const openvdb::FloatGrid& prototype, float background_mm,
                                  ZRange core, std::span<const openvdb::Coord> origins,
                                  std::span<const LeafValues> leaves,
                                  std::span<const openvdb::CoordBBox> inside);

/// Returns an empty grid like `surface` with another background, which is also its held band.
openvdb::FloatGrid::Ptr emptySurface(const openvdb::FloatGrid& surface, float background_mm);

}  // namespace vdbdither
