#pragma once

#include <map>
#include <set>
#include <string>
#include <vector>

#include "vdbdither/model/grid.h"
#include "vdbdither/model/lattice.h"

namespace vdbdither {

using Grids = std::map<std::string, GridConstPtr, std::less<>>;
using GridNames = std::set<std::string, std::less<>>;

/// All grids over a range of layers. The whole volume is the slab whose core is every layer.
struct Slab {
  ZRange core;   ///< the layers this slab stands for
  ZRange valid;  ///< the layers with voxels to read: the core and the requested halo, cut at the
                 ///< job's box
  Grids grids;   ///< by name; voxels outside `valid` have no meaning
  /// Of a filter with inputs of its own (`Operator::inputs`): the grids of each over the core, in
  /// the same order. Empty where an input has no layer there.
  std::vector<Grids> inputs = {};
};

}  // namespace vdbdither
