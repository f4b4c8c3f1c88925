#pragma once

#include <openvdb/Types.h>

#include "vdbdither/engine/option_groups.h"
#include "vdbdither/model/schema.h"

namespace vdbdither {

/// Returns the pitch in mm that --printer or --pitch sets. The profile of a printer is added to the
/// metadata of `schema`, with the layer that --layer sets.
///
/// Throws UsageError unless exactly one of the two is given, and if the printer does not take
/// layers as high as --layer; and what readPrinterProfile throws.
openvdb::Vec3d targetPitchMm(const LatticeOptions& target, Schema& schema);

/// The lattice of a part between `min_mm` and `max_mm`, with the voxels within `margin_mm` of that
/// box. Along y come `refine_y` voxels in place of one, their centres symmetrically about its own.
/// Throws DataError where there are more than can be counted.
Lattice latticeAround(const openvdb::Vec3d& min_mm, const openvdb::Vec3d& max_mm, double margin_mm,
                      const openvdb::Vec3d& pitch_mm, int refine_y = 1);

}  // namespace vdbdither
