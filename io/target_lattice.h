#pragma once

#include <string>

#include <openvdb/Types.h>

#include "vdbdither/schema.h"

namespace vdbdither {

/// The pitch that --printer or --pitch asks a source for, mm; a printer's profile goes into the
/// schema's metadata.
///
/// \param printer  name or file of a profile, or empty
/// \param pitch    DX,DY,DZ: three lengths between 1 µm and 10 mm, or empty
///
/// Throws UsageError unless one of the two is given and sound, and what readPrinterProfile throws.
openvdb::Vec3d targetPitchMm(const std::string& printer, const std::string& pitch, Schema& schema);

}  // namespace vdbdither
