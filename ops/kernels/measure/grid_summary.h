#pragma once

#include <cstdint>
#include <map>

#include "vdbdither/model/openvdb.h"

namespace vdbdither {

/// A summary of a grid, independent of how the grid is divided into slabs.
struct GridSummary {
  std::uint64_t active_voxels = 0;
  openvdb::CoordBBox box;       ///< of the active voxels
  openvdb::Vec3d minimum{0.0};  ///< of the active values, by component; scalars in x
  openvdb::Vec3d maximum{0.0};  ///< the same
  std::uint64_t leaves = 0;
  std::uint64_t leaf_bytes = 0;                  ///< in memory
  std::map<std::int64_t, std::uint64_t> counts;  ///< active voxels by value, for 32-bit integers

  /// Adds the summary of other layers.
  void add(const GridSummary& other);
};

/// Returns the summary of a grid. Throws DataError for types that slabs cannot carry.
GridSummary gridSummary(const openvdb::GridBase& grid);

}  // namespace vdbdither
