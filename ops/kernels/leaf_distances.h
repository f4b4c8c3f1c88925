#pragma once

#include <array>
#include <cstdint>

#include <openvdb/math/Coord.h>

#include "ops/kernels/mesh_features.h"

namespace vdbdither {

/// Eight planes of constant x, bit 8·j + k in each: OpenVDB's own order of a leaf's mask.
using LeafBits = std::array<std::uint64_t, 8>;

/// The voxels of a leaf while their nearest features are sought, in OpenVDB's order.
struct LeafDistances {
  static constexpr int voxels = 512;

  alignas(64) double squared[voxels];        ///< mm², the smallest so far
  alignas(64) std::int64_t nearest[voxels];  ///< the name of the feature that gave it, if kept
};

/// A feature whose forms are functions of absolute voxel indices, and the voxels that its region
/// reaches.
struct LatticeFeature {
  const LinearForm* forms;  ///< `rank` distance forms, then the bounds
  int rank;
  int count;
  double band_mm;  ///< beyond it from the plane or line distances are of no use
  openvdb::CoordBBox reach;
};

/// What runs in the innermost loops, compiled for one instruction set. All give the same bits.
struct LeafKernels {
  /// Lowers the leaf at `origin` to the distances of `feature` wherever its bounds hold; of equal
  /// distances the one met first stays. `name` is kept where `track` asks for it.
  void (*lower)(const LatticeFeature& feature, const openvdb::Coord& origin, std::int64_t name,
                bool track, LeafDistances& leaf);

  /// Values in mm: −distance where `inside`, else +distance; ±background where not below `limit_mm`
  /// or not in `exists`. Returns the bits of the voxels that are.
  LeafBits (*finish)(const LeafDistances& leaf, const LeafBits& inside, const LeafBits& exists,
                     double limit_mm, float background_mm, float* values);
};

/// The kernels for this processor.
const LeafKernels& leafKernels();

/// The same for any processor, to compare with.
const LeafKernels& portableLeafKernels();

}  // namespace vdbdither
