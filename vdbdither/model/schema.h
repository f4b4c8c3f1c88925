#pragma once

#include <map>
#include <string>

#include "vdbdither/model/slab.h"

namespace vdbdither {

/// What travels ahead of the slabs: everything that is known before the first voxel.
struct Schema {
  Lattice lattice;
  /// Empty grids that stand for those of every slab: name, type, class, background, transform,
  /// metadata.
  Grids grids;
  /// File metadata by key: `vdbdither:history`, `vdbdither:printer`, `vdbdither:materials`, …
  std::map<std::string, std::string, std::less<>> metadata;
  /// How many leaf nodes its grids hold in the fullest row of leaves (eight layers); zero where
  /// unknown. Feeds the estimate of memory.
  double leaves_per_row = 0;
  /// How many they hold in all; zero where unknown. Feeds the estimates of disk and time.
  double leaves = 0;
  /// How many of these lie at the surface, within about a voxel's diameter of it: all but where
  /// grids hold distances farther away. Feeds the same.
  double surface_leaves = 0;
};

}  // namespace vdbdither
