#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include <openvdb/Types.h>

#include "ops/kernels/mask/mask_kernel.h"

namespace vdbdither {

/// The code that adds and scans energies. Every set gives the same ranks.
enum class InstructionSet { baseline, avx2 };

/// The best set that this processor runs.
InstructionSet bestInstructionSet();

/// What a mask is made of.
struct VoidAndCluster {
  openvdb::Coord size{32, 32, 32};  ///< period along x, y, z, each 1 … 256; flat where z is 1
  MaskKernel kernel;
  std::uint64_t seed = 1;
};

/// A permutation of 0 … count - 1, the same for a seed everywhere. As ranks it is white noise.
std::vector<std::uint32_t> randomPermutation(std::uint32_t count, std::uint64_t seed);

/// How many voxels are set when void and cluster starts: a tenth, at least one, less than half
/// where that can be.
std::uint32_t initialCount(std::uint32_t count);

/// The smallest weight, relative to the kernel's peak, that takes part in the energies of a tile.
/// Zero up to 32768 voxels: all that the integers resolve, 2^-40. Above, 2^-12: a rank costs what
/// it touches.
double smallestWeight(const openvdb::Coord& size);

/// About what voidAndCluster takes with the best instruction set, as CPU time of one thread.
double voidAndClusterSeconds(const VoidAndCluster& settings);

/// The ranks of a mask by void and cluster, x fastest: a permutation of 0 … n - 1.
///
/// The voxels that randomPermutation(n, seed) puts below initialCount(n) start as set. The tightest
/// cluster moves to the largest void until it would move back. Then the tightest clusters are taken
/// out from rank initialCount - 1 down to 0, and from the same pattern the largest voids are filled
/// up to rank n - 1.
///
/// Energies are sums of weights rounded to integers, 64 bits up to 32768 voxels and 32 bits above,
/// so the order is the same for any compiler and instruction set. Of equal energies the largest
/// void is the one whose value in randomPermutation is least, the tightest cluster the one whose
/// value is greatest; above 32768 voxels by its last four bits only, then by where the voxels are
/// stored.
///
/// progress: called now and then with the fraction done, 0 … 1; may throw to stop.
std::vector<std::uint32_t> voidAndCluster(const VoidAndCluster& settings,
                                          const std::function<void(double fraction)>& progress = {},
                                          InstructionSet instructions = bestInstructionSet());

}  // namespace vdbdither
