#pragma once

#include <cstdint>
#include <vector>

#include <openvdb/Types.h>

namespace vdbdither {

/// The ranks, a permutation of 0 … n - 1, of the voxels of a periodic tile by the value of gradient
/// noise (Perlin, "Improving Noise", 2002) whose cells are cubes of `cell` voxels; x fastest. Equal
/// values are ordered by randomPermutation(n, seed). The same for a seed everywhere.
///
/// size: each a multiple of cell; cell ≥ 2.
std::vector<std::uint32_t> gradientNoiseRanks(const openvdb::Coord& size, int cell,
                                              std::uint64_t seed);

}  // namespace vdbdither
