#pragma once

#include <cstdint>

#include "ops/kernels/mesh_features.h"

namespace vdbdither {

/// The 8 × 8 × 8 voxels of a leaf while their nearest features are sought, z fastest.
struct LeafDistances {
  static constexpr int voxels = 512;

  alignas(64) double squared[voxels];  ///< mm², the smallest so far
  alignas(
      64) std::int64_t nearest[voxels];  ///< the feature that gave it; kept only where asked for
};

/// A feature's forms in voxels of one leaf: x·i + y·j + z·k + constant for i, j, k = 0 … 7.
struct LeafFeature {
  static constexpr int max_forms = 3 + MeshFeature::max_bounds;

  int rank = 0;
  int forms = 0;  ///< distance forms, then bounds
  int i_begin = 0, i_end = 8;
  int j_begin = 0, j_end = 8;
  double x[max_forms], y[max_forms], z[max_forms], constant[max_forms];
};

/// Lowers `leaf` to the distances of `feature` wherever its bounds hold. A feature met earlier wins
/// a tie.
using FeatureSweep = void (*)(const LeafFeature& feature, std::int64_t name, LeafDistances& leaf);

/// The sweep for this processor; `track` keeps `LeafDistances::nearest` too. All variants give the
/// same bits.
FeatureSweep featureSweep(bool track);

/// The same for any processor, to compare with.
FeatureSweep portableFeatureSweep(bool track);

}  // namespace vdbdither
