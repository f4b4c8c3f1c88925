#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <string>

#include <openvdb/openvdb.h>

#include "ops/kernels/mask/void_and_cluster.h"

namespace vdbdither {

/// Returns a grid `mask` without voxels, with the metadata `mask:size` and `mask:kind`.
openvdb::FloatGrid::Ptr emptyMask(const openvdb::Coord& size, const std::string& kind);

/// The same for a void-and-cluster mask, also with its seed, its kernel and `mask:generation`,
/// which is raised whenever a change of the program gives other ranks for the same settings.
openvdb::FloatGrid::Ptr emptyMask(const VoidAndCluster& settings);

/// Adds the thresholds (rank + ½) / n of the layers begin ≤ z < end to a grid made by emptyMask.
/// `ranks` are the n ranks of the whole tile, x fastest.
void addThresholds(std::span<const std::uint32_t> ranks, int begin, int end,
                   openvdb::FloatGrid& mask);

/// Makes a void-and-cluster mask. `progress` is that of voidAndCluster.
openvdb::FloatGrid::Ptr maskOf(const VoidAndCluster& settings,
                               const std::function<void(double fraction)>& progress = {});

/// The mask that is built and installed with the program: 64³, `axis-mix`, σ = 0.8, seed 1.
/// docs/masks.md gives the reasons.
VoidAndCluster defaultMask();

/// The mask of halftones on a lattice: `exponential` with a length of 70 µm in all directions, or
/// of 1 to 3.5 times the mean pitch where 70 µm lie outside of that, and a space weight of 3. The
/// tile has powers of two, at least 1.75 mm (16 … 256 voxels) along each axis, but no more than
/// 2^19 voxels. docs/halftone.md gives the reasons.
///
/// `seed` is ≥ 0. The seed of the mask is 2^30 more, modulo 2^31: masks of one seed and of as many
/// voxels start from one random order and are alike, and a halftone must not follow the mask of the
/// dither.
VoidAndCluster halftoneMask(const openvdb::Vec3d& pitch_mm, int seed);

/// The mask of the paper: 128³, σ = 1.1, `peters`, seed 1.
VoidAndCluster paperMask();

}  // namespace vdbdither
