#pragma once

#include <span>

#include "vdbdither/model/known_grids.h"
#include "vdbdither/model/openvdb.h"

namespace vdbdither {

/// Which of several parts has a voxel that lies in all of them.
enum class PartOrder { first, last };

/// Returns the part that each voxel belongs to, counted from 1: the first, or the last, of
/// `surfaces` that holds it (d < 0, tiles and inactive voxels too), or where none does but some are
/// near, the nearest. Other voxels are 0. The number of parts is stored in the grid's metadata.
/// \param surfaces  distances of each part in mm, all on one lattice, active within their bands
openvdb::Int32Grid::Ptr partIndex(std::span<const openvdb::FloatGrid::ConstPtr> surfaces,
                                  PartOrder order = PartOrder::first);

}  // namespace vdbdither
