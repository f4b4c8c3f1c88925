#pragma once

#include <cstdint>
#include <vector>

#include <openvdb/Types.h>

namespace vdbdither {

/// Returns the ranks of the voxels of a periodic tile by the value of gradient noise (Perlin 2002)
/// whose cells are cubes of `cell` voxels: a permutation of 0 … n - 1, x fastest. Equal values are
/// ordered by randomPermutation(n, seed). The ranks of a seed are the same on every machine.
///
/// Each of `size` must be a multiple of `cell`, and `cell` ≥ 2.
std::vector<std::uint32_t> gradientNoiseRanks(const openvdb::Coord& size, int cell,
                                              std::uint64_t seed);

}  // namespace vdbdither
