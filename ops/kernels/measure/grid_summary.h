#pragma once

#include <cstdint>
#include <map>

#include "vdbdither/model/openvdb.h"

namespace vdbdither {

/// What a grid holds. Independent of how the grid was cut into slabs.
struct GridSummary {
  std::uint64_t active_voxels = 0;
  openvdb::CoordBBox box;        ///< of the active voxels
  openvdb::Vec3d least{0.0};     ///< of the active values, by component; scalars in x
  openvdb::Vec3d greatest{0.0};  ///< the same
  std::uint64_t leaves = 0;
  std::uint64_t leaf_bytes = 0;                  ///< in memory
  std::map<std::int64_t, std::uint64_t> counts;  ///< active voxels by value, of 32-bit integers

  /// Takes in what other layers hold.
  void add(const GridSummary& other);
};

/// Throws DataError for types that slabs cannot carry.
GridSummary gridSummary(const openvdb::GridBase& grid);

}  // namespace vdbdither
