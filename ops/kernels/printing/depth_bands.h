#pragma once

#include <cstdint>
#include <span>

#include "vdbdither/model/lattice.h"
#include "vdbdither/model/openvdb.h"

namespace vdbdither {

/// A value for the voxels down to a depth.
struct DepthBand {
  double to_mm = 0;  ///< inclusive
  std::int32_t value = 0;
};

/// Returns a value for every voxel of `solid` by its depth: the distance in mm from its centre to
/// the centre of the nearest voxel that is not in `solid`. Under a flat face in a lattice plane the
/// depth of the n-th layer of voxels is therefore that of its far side, and a band as thick as n
/// layers holds n of them.
///
/// Exact to the rounding of single precision. The time depends on the bands; voxels below the last
/// band are returned as tiles.
/// \param pitch_mm  of the voxels
/// \param region  in x and y, inclusive: where `solid` may have voxels
/// \param core  the layers to compute
/// \param valid  the layers of `solid` that count; others are empty
/// \param bands  in rising order of their depths
/// \param beneath  the value below the last band
openvdb::Int32Grid::Ptr valueByDepth(const openvdb::BoolGrid& solid, const openvdb::Vec3d& pitch_mm,
                                     const openvdb::CoordBBox& region, ZRange core, ZRange valid,
                                     std::span<const DepthBand> bands, std::int32_t beneath);

/// Returns how many layers below and above a voxel its band depends on.
int depthReach(std::span<const DepthBand> bands, double layer_mm);

}  // namespace vdbdither
