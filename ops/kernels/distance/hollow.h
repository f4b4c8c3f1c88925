#pragma once

#include <span>

#include <openvdb/openvdb.h>

#include "ops/kernels/distance/drain.h"
#include "vdbdither/model/lattice.h"

namespace vdbdither {

/// A shell under the surface: max(d, −(d + thickness)), less the drains.
///
/// Its inner surface is a zero set of its own, with true distances from the side of the cavity and,
/// within the shell, all but behind the re-entrant edges of `combined`. A voxel whose distance is
/// not known is beyond the shell on its side. A centre on the inner surface is inside where the
/// shell is at the point shifted by (ε, ε³, ε²).
///
/// \param valid          the layers of `surface` that may be read
/// \param surface        d in mm; holds thickness_mm + background_mm
/// \param background_mm  of the result: how far from its surfaces distances are kept
openvdb::FloatGrid::Ptr hollowed(const openvdb::FloatGrid& surface, const Lattice& lattice,
                                 double thickness_mm, std::span<const Drain> drains,
                                 float background_mm, ZRange core, ZRange valid);

}  // namespace vdbdither
