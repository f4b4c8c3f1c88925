#pragma once

#include <span>

#include <openvdb/openvdb.h>

#include "ops/kernels/distance/drain.h"
#include "vdbdither/model/lattice.h"

namespace vdbdither {

/// Returns a shell under the surface, max(d, −(d + thickness)), minus the drains.
///
/// The inner surface is a zero set with true distances in the cavity and, within the shell,
/// everywhere except behind re-entrant edges; see `combined`. A voxel whose distance is unknown
/// counts as beyond the shell on its side. A centre on the inner surface is inside if the shell is
/// at the point shifted by (ε, ε³, ε²).
///
/// \param surface  d in mm, held up to thickness_mm + background_mm
/// \param background_mm  of the result: the distance up to which it holds distances
/// \param valid  the layers of `surface` that may be read
openvdb::FloatGrid::Ptr hollowed(const openvdb::FloatGrid& surface, const Lattice& lattice,
                                 double thickness_mm, std::span<const Drain> drains,
                                 float background_mm, ZRange core, ZRange valid);

}  // namespace vdbdither
