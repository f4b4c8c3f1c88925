#pragma once

#include <openvdb/openvdb.h>

#include "vdbdither/model/lattice.h"

namespace vdbdither {

enum class Csg { unite, intersect, subtract };

/// The distance to what two parts make together: min(a, b), max(a, b) or max(a, −b), on one
/// lattice.
///
/// The zero set is exact, and so is every sign. Outside of a union the distance is, too; inside it,
/// as outside of an intersection or a difference, |d| is never too large, and too small only where
/// the nearest surface of one part was taken away by the other. Where the two surfaces meet in an
/// edge and enclose the angle φ < π (of empty space for a union, else of material), the true
/// distance behind that edge is at most |d| / sin(φ/2): at a right angle √2 |d|. Of the voxels that
/// dithering decides, those behind a re-entrant edge are thus decided as if they were a little
/// nearer to it.
///
/// The background is the smaller of the two; a voxel is active where the one that gives the value
/// is, nearer than that. Canonical.
openvdb::FloatGrid::Ptr combined(const openvdb::FloatGrid& a, const openvdb::FloatGrid& b,
                                 Csg operation, ZRange core);

/// An empty grid as `combined` makes them.
openvdb::FloatGrid::Ptr emptyCombined(const openvdb::FloatGrid& a, const openvdb::FloatGrid& b);

/// The parts of a united with those of b, whose numbers are raised by `shift`. A voxel inside of
/// both belongs to a unless `b_first`; one inside of neither, but near, to the nearer, to a where
/// they are equally near.
///
/// \param a_parts, b_parts  `part`, or null: all of a, or of b, is part 1
openvdb::Int32Grid::Ptr unitedParts(const openvdb::FloatGrid& a, const openvdb::FloatGrid& b,
                                    const openvdb::Int32Grid* a_parts,
                                    const openvdb::Int32Grid* b_parts, int shift, bool b_first,
                                    ZRange core);

}  // namespace vdbdither
