#pragma once

#include <array>
#include <memory>
#include <span>
#include <vector>

#include <openvdb/openvdb.h>

#include "ops/kernels/leaf/leaf_bits.h"
#include "vdbdither/model/lattice.h"

namespace vdbdither {

/// The distances of a leaf's voxels while they change, in its order. Those of inactive voxels tell
/// the sign alone.
struct LeafValues {
  std::array<float, 512> distance;
  LeafBits active{};

  /// Those of `surface` at `origin`, be it a leaf or a tile there.
  static LeafValues of(const openvdb::tree::ValueAccessor<const openvdb::FloatTree, false>& surface,
                       const openvdb::Coord& origin);
};

/// A level set of `prototype`'s name, transform and metadata made of leaves, each over `core`
/// alone: voxels are active where they are so in `leaves` and nearer than `background_mm`, and hold
/// ±background elsewhere; `inside` is filled first. Canonical.
///
/// \param leaves  by their origins
openvdb::FloatGrid::Ptr surfaceOf(const openvdb::FloatGrid& prototype, float background_mm,
                                  ZRange core, std::span<const openvdb::Coord> origins,
                                  std::span<const LeafValues> leaves,
                                  std::span<const openvdb::CoordBBox> inside);

/// An empty grid like `surface` with another background, which all of its band holds.
openvdb::FloatGrid::Ptr emptySurface(const openvdb::FloatGrid& surface, float background_mm);

}  // namespace vdbdither
