#pragma once

#include <span>

#include "vdbdither/model/grid.h"

namespace vdbdither {

/// Returns a grid with a copy of all that `grid` holds at each of the offsets, and background
/// elsewhere. Throws DataError for a type that slabs cannot carry.
/// @param offsets  multiples of the edge of a leaf, so far apart that no leaves of copies overlap
GridConstPtr copiesAt(const GridConstPtr& grid, std::span<const openvdb::Coord> offsets);

}  // namespace vdbdither
