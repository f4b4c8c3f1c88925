#pragma once

#include "vdbdither/model/lattice.h"
#include "vdbdither/model/openvdb.h"

namespace vdbdither {

/// Returns the area in mm² of the zero set of a level set, by marching tetrahedra: distances are
/// interpolated linearly within the six (Kuhn) tetrahedra of every cell of eight neighbouring
/// voxels. Exact for planes; on smooth surfaces it is too small by a share that falls with the
/// square of the pitch, and edges are cut off.
///
/// Counts the cells whose lower voxels are in `layers`. `upper` holds the layer above them, `lower`
/// all others; each cell must have a distance at its lowest corner. The area of every leaf is
/// rounded to 2⁻²⁴ mm², so that sums do not depend on their order.
double surfaceArea(const openvdb::FloatGrid& lower, const openvdb::FloatGrid& upper, ZRange layers,
                   const openvdb::Vec3d& pitch_mm);

}  // namespace vdbdither
