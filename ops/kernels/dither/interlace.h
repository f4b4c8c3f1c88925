#pragma once

#include <openvdb/openvdb.h>

#include "vdbdither/model/lattice.h"

namespace vdbdither {

/// Interlacing (Kritchman 2010; eq. (11) of Morsy, Brunton, Urban 2022, with ± a quarter voxel as
/// its text says): v in V′ ⇔ d(c(v) + (0, s·dy/4, 0)) < 0 with s = −1 on even slices and +1 on odd
/// ones, by absolute index.

/// Picks rows of distances that are sampled twice as finely in y: the refined rows 2j and 2j + 1
/// lie a quarter of the plain pitch below and above the plain row j. `transform` is that of the
/// plain lattice.
openvdb::BoolGrid::Ptr interlacedByPicking(const openvdb::FloatGrid& refined, ZRange core,
                                           const openvdb::math::Transform& transform);

/// Interpolates distances on the plain lattice: ¾ d(j) + ¼ d(j + s) in double precision. A voxel
/// that is inactive, or whose neighbour is, is decided by the sign of its own d.
openvdb::BoolGrid::Ptr interlacedByInterpolation(const openvdb::FloatGrid& surface, ZRange core);

}  // namespace vdbdither
