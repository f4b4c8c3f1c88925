#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include <openvdb/Types.h>

#include "ops/kernels/mask/mask_kernel.h"
#include "vdbdither/model/instruction_set.h"

namespace vdbdither {

/// The settings of a void-and-cluster mask.
struct VoidAndCluster {
  openvdb::Coord size{32, 32, 32};  ///< period along x, y, z, each 1 … 256; flat where z is 1
  MaskKernel kernel;
  std::uint64_t seed = 1;
};

/// Returns a permutation of 0 … count - 1, the same for a seed on every machine. As ranks it is
/// white noise.
std::vector<std::uint32_t> randomPermutation(std::uint32_t count, std::uint64_t seed);

/// Returns how many voxels are set when void and cluster starts: a tenth, at least one, and less
/// than half if possible.
std::uint32_t initialCount(std::uint32_t count);

/// Returns the smallest weight, relative to the kernel's peak, that contributes to the energies of
/// a tile. It is zero up to 32768 voxels, where the integers resolve 2^-40, and 2^-12 above,
/// because the time of a rank depends on the weights that it changes.
double smallestWeight(const openvdb::Coord& size);

/// Returns the approximate CPU time of voidAndCluster with the best instruction set.
double voidAndClusterSeconds(const VoidAndCluster& settings);

/// Returns the ranks of a mask by void and cluster, x fastest: a permutation of 0 … n - 1.
///
/// The voxels whose value in randomPermutation(n, seed) is below initialCount(n) are set first. The
/// tightest cluster moves to the largest void until it would move back. Then the tightest clusters
/// are removed, from rank initialCount - 1 down to 0, and from the same pattern the largest voids
/// are filled, up to rank n - 1.
///
/// Energies are sums of weights rounded to integers, 64 bits up to 32768 voxels and 32 bits above,
/// so that the order is the same for any compiler and instruction set. Of equal energies, the
/// largest void is the one with the smallest value in randomPermutation, and the tightest cluster
/// the one with the largest. Above 32768 voxels only the last four bits of the value count, then
/// the place where the voxel is stored.
///
/// `progress` is called from time to time with the fraction done, 0 … 1; it may throw to stop.
/// `instructions` are those of the code that adds and scans energies.
std::vector<std::uint32_t> voidAndCluster(const VoidAndCluster& settings,
                                          const std::function<void(double fraction)>& progress = {},
                                          InstructionSet instructions = bestInstructionSet());

}  // namespace vdbdither
