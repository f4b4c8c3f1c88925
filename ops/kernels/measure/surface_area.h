#pragma once

#include "vdbdither/model/lattice.h"
#include "vdbdither/model/openvdb.h"

namespace vdbdither {

/// Area in mm² of the zero set of a level set, by marching tetrahedra: distances are interpolated
/// linearly within the six tetrahedra (Kuhn's) of every cell of eight neighbouring voxels. Exact
/// for planes; of smooth surfaces it misses a share that falls with the square of the pitch. Edges
/// are cut off.
///
/// Counts the cells whose lower voxels are in `layers`. `upper` holds the layer above them, `lower`
/// all others; each cell must have a distance at its least corner. Every leaf's share is rounded to
/// 2⁻²⁴ mm², so that sums come out the same in any order.
double surfaceArea(const openvdb::FloatGrid& lower, const openvdb::FloatGrid& upper, ZRange layers,
                   const openvdb::Vec3d& pitch_mm);

}  // namespace vdbdither
