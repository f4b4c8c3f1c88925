#pragma once

#include <cstdint>

#include "vdbdither/model/openvdb.h"

namespace vdbdither {

/// Where two grids hold different voxels.
struct GridDifference {
  std::uint64_t voxels = 0;
  openvdb::Coord first;  ///< of them the lowest, then the one with the least y, then x
  double largest = 0;    ///< of the components; 0 where only states differ

  /// Takes in what was found elsewhere.
  void add(const GridDifference& other);
};

/// The voxels at which `a` and `b`, grids of one type, differ: in being active, or in value by more
/// than `tolerance` (nan equals nan). Tiles are compared as tiles. Throws DataError for types that
/// slabs cannot carry.
GridDifference gridDifference(const openvdb::GridBase& a, const openvdb::GridBase& b,
                              double tolerance);

}  // namespace vdbdither
