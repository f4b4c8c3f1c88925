#pragma once

#include <cstdint>
#include <span>

#include "vdbdither/model/lattice.h"
#include "vdbdither/model/openvdb.h"

namespace vdbdither {

/// What voxels hold down to a depth.
struct DepthBand {
  double to_mm = 0;  ///< inclusive
  std::int32_t value = 0;
};

/// A value for every voxel of `solid` by its depth: the distance, mm, from its centre to the centre
/// of the nearest voxel that is not in `solid`. Under a flat face that lies in the lattice the n-th
/// layer of voxels thus has the depth of its far side, and a band as thick as n layers holds n of
/// them.
///
/// `pitch_mm`: of the voxels. `region`: in x and y, where `solid` may have voxels, inclusive.
/// `core`: the layers wanted. `valid`: the layers of `solid` that count; beyond them all is empty.
/// `bands`: their depths rise. `beneath`: the value below them all. Exact but for the rounding of
/// single precision. The cost follows the bands: what lies deeper than the last one comes back as
/// tiles.
openvdb::Int32Grid::Ptr valueByDepth(const openvdb::BoolGrid& solid, const openvdb::Vec3d& pitch_mm,
                                     const openvdb::CoordBBox& region, ZRange core, ZRange valid,
                                     std::span<const DepthBand> bands, std::int32_t beneath);

/// How many layers below and above a voxel decide its band.
int depthReach(std::span<const DepthBand> bands, double layer_mm);

}  // namespace vdbdither
