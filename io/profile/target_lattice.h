#pragma once

#include <string>

#include <openvdb/Types.h>

#include "vdbdither/model/schema.h"

namespace vdbdither {

/// The pitch that --printer or --pitch asks a source for, mm; a printer's profile goes into the
/// schema's metadata.
///
/// \param printer  name or file of a profile, or empty
/// \param pitch    DX,DY,DZ: three lengths between 1 µm and 10 mm, or empty
///
/// Throws UsageError unless one of the two is given and sound, and what readPrinterProfile throws.
openvdb::Vec3d targetPitchMm(const std::string& printer, const std::string& pitch, Schema& schema);

/// The lattice of a part between `min_mm` and `max_mm`, with the voxels within `margin_mm` of that
/// box. Along y come `refine_y` voxels in place of one, their centres symmetrically about its own.
/// Throws DataError where there are more than can be counted.
Lattice latticeAround(const openvdb::Vec3d& min_mm, const openvdb::Vec3d& max_mm, double margin_mm,
                      const openvdb::Vec3d& pitch_mm, int refine_y = 1);

}  // namespace vdbdither
