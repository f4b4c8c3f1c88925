#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <string>

#include <openvdb/openvdb.h>

#include "ops/kernels/mask/void_and_cluster.h"

namespace vdbdither {

/// A grid `mask` without voxels whose metadata say what it is: `mask:size` and `mask:kind`.
openvdb::FloatGrid::Ptr emptyMask(const openvdb::Coord& size, const std::string& kind);

/// The same of a void-and-cluster mask: with its seed and kernel, and with `mask:generation`, which
/// rises whenever the same settings come to give other ranks.
openvdb::FloatGrid::Ptr emptyMask(const VoidAndCluster& settings);

/// Puts the thresholds (rank + ½) / n of the layers begin ≤ z < end into a grid made by emptyMask.
/// ranks: the n of the whole tile, x fastest.
void addThresholds(std::span<const std::uint32_t> ranks, int begin, int end,
                   openvdb::FloatGrid& mask);

/// Makes a void-and-cluster mask. progress: as in voidAndCluster.
openvdb::FloatGrid::Ptr maskOf(const VoidAndCluster& settings,
                               const std::function<void(double fraction)>& progress = {});

/// The mask that is made with the program and installed: 64³, `axis-mix`, σ = 0.8, seed 1. Why this
/// one: docs/masks.md.
VoidAndCluster defaultMask();

/// The mask of the paper: 128³, σ = 1.1, `peters`, seed 1.
VoidAndCluster paperMask();

}  // namespace vdbdither
