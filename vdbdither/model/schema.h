#pragma once

#include <map>
#include <string>

#include "vdbdither/model/footprint.h"
#include "vdbdither/model/slab.h"

namespace vdbdither {

/// Everything about a job's slabs that is known before the first voxel.
struct Schema {
  Lattice lattice;
  /// Empty grids that stand for those of every slab: name, type, class, background, transform,
  /// metadata.
  Grids grids;
  /// File metadata by key: `vdbdither:history`, `vdbdither:printer`, `vdbdither:materials`, …
  std::map<std::string, std::string, std::less<>> metadata;
  Footprint footprint;
};

}  // namespace vdbdither
