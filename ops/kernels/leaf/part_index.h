#pragma once

#include <span>

#include "vdbdither/model/known_grids.h"
#include "vdbdither/model/openvdb.h"

namespace vdbdither {

/// Which part a voxel belongs to, from 1: the first of `surfaces` that holds it (d < 0, tiles and
/// inactive voxels too), or where none does but some are near, the nearest. 0 elsewhere.
///
/// \param surfaces  d in mm of each part, all on one lattice; active within their bands
/// How many parts there are goes with the grid, as its metadata.
openvdb::Int32Grid::Ptr partIndex(std::span<const openvdb::FloatGrid::ConstPtr> surfaces);

}  // namespace vdbdither
