#pragma once

#include <cstdint>

#include "vdbdither/model/openvdb.h"

namespace vdbdither {

/// The differences between two grids.
struct GridDifference {
  std::uint64_t voxels = 0;
  openvdb::Coord first;  ///< the first different voxel, by z, then y, then x
  double largest = 0;    ///< maximum difference of a component; 0 if only states differ

  /// Adds the differences in other layers.
  void add(const GridDifference& other);
};

/// Compares two grids of one type. Voxels differ in their state, or in value by more than
/// `tolerance` (nan equals nan). Tiles are compared as tiles. Throws DataError for types that slabs
/// cannot carry.
GridDifference gridDifference(const openvdb::GridBase& a, const openvdb::GridBase& b,
                              double tolerance);

}  // namespace vdbdither
