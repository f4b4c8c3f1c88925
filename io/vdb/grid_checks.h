#pragma once

#include <optional>
#include <string>

#include "vdbdither/model/slab.h"

namespace vdbdither {

/// Whether an index is near enough to 0 for boxes to be counted: within 2^30 along each axis.
bool isCountable(const openvdb::Coord& index);

/// Returns what no operator can work with in a grid, with the first voxel that has it and what to
/// do, or nothing for a sound grid: a value that is not a finite number, or distances or voxels
/// that are inside everywhere beyond their voxels.
std::optional<std::string> faultOf(const openvdb::GridBase& grid);

/// Grids that enter from files and pipes pass here once. Throws DataError that begins with `where`
/// and names the grid, if a grid has a fault. Voxels of bool grids that are active and false become
/// inactive: a voxel is in where it is active and true.
void admitGrids(Grids& grids, const std::string& where);

/// The check of one grid and its name. Returns the grid.
GridConstPtr checked(const Grids::value_type& grid, const std::string& where);

}  // namespace vdbdither
