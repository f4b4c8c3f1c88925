#pragma once

#include <map>
#include <string>

#include "vdbdither/model/grid.h"
#include "vdbdither/model/lattice.h"

namespace vdbdither {

using Grids = std::map<std::string, GridConstPtr, std::less<>>;

/// All grids over a range of layers. The whole volume is the slab whose core is every layer.
struct Slab {
  ZRange core;   ///< the layers this slab stands for
  ZRange valid;  ///< the layers whose voxels are there to read: the core and the halo asked for,
                 ///< cut at the job's box
  Grids grids;   ///< by name; what lies outside `valid` means nothing
};

}  // namespace vdbdither
