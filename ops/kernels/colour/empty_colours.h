#pragma once

#include "vdbdither/model/lattice.h"
#include "vdbdither/model/openvdb.h"

namespace vdbdither {

/// Returns `Cd` without voxels.
openvdb::Vec3SGrid::Ptr emptyColours(const Lattice& lattice);

/// Returns `Alpha` without voxels.
openvdb::FloatGrid::Ptr emptyOpacities(const Lattice& lattice);

}  // namespace vdbdither
