#pragma once

#include <openvdb/openvdb.h>

#include "vdbdither/model/lattice.h"

namespace vdbdither {

enum class Csg { unite, intersect, subtract };

/// Returns the distance to the combination of two parts on one lattice: min(a, b), max(a, b) or
/// max(a, −b).
///
/// The zero set and all signs are exact, and outside a union so is the distance. Inside a union,
/// and outside an intersection or a difference, |d| is never too large, and too small only where
/// the other part has removed the nearest surface. Where the two surfaces meet in an edge at the
/// angle φ < π (of empty space for a union, of material otherwise), the true distance behind that
/// edge is at most |d| / sin(φ/2): √2 |d| at a right angle. Dithering therefore treats voxels
/// behind a re-entrant edge as if they were a little nearer to it.
///
/// The background is the smaller of the two. A voxel is active if the one that gives its value is,
/// and is nearer than the background. The tree is canonical.
openvdb::FloatGrid::Ptr combined(const openvdb::FloatGrid& a, const openvdb::FloatGrid& b,
                                 Csg operation, ZRange core);

/// Returns an empty grid like those of `combined`.
openvdb::FloatGrid::Ptr emptyCombined(const openvdb::FloatGrid& a, const openvdb::FloatGrid& b);

/// Returns the parts of a united with those of b, whose numbers are raised by `shift`. A voxel
/// inside both belongs to a unless `b_first`; a voxel near, but inside neither, belongs to the
/// nearer, or to a if they are equally near.
///
/// The grids `a_parts` and `b_parts` are null if all of a, or of b, is part 1.
openvdb::Int32Grid::Ptr unitedParts(const openvdb::FloatGrid& a, const openvdb::FloatGrid& b,
                                    const openvdb::Int32Grid* a_parts,
                                    const openvdb::Int32Grid* b_parts, int shift, bool b_first,
                                    ZRange core);

}  // namespace vdbdither
