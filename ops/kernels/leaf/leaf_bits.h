#pragma once

// The leaf family: kernels on single OpenVDB leaves, their bits and their neighbourhoods, and on
// whole trees made of leaves.

#ifdef __SSE2__
#include <emmintrin.h>
#endif

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <memory>
#include <span>
#include <vector>

#include <openvdb/openvdb.h>
#include <tbb/parallel_for.h>

#include "vdbdither/model/lattice.h"

namespace vdbdither {

using FloatLeaf = openvdb::FloatTree::LeafNodeType;

/// One bit per voxel of a leaf, laid out as OpenVDB lays out its masks: word x, bit 8·y + z.
using LeafBits = std::array<std::uint64_t, 8>;

inline constexpr LeafBits no_bits{};

/// A word whose rows along z are all `row`.
constexpr std::uint64_t everyRow(std::uint8_t row) { return 0x0101010101010101U * row; }

/// `core` and `layers` more on each side, limited to `valid`.
inline ZRange grownWithin(ZRange core, int layers, ZRange valid) {
  return intersection({core.begin - layers, core.end + layers}, valid);
}

/// The bits of a row along z that lie in `layers`, for a leaf whose lowest layer is `leaf_z`.
inline std::uint8_t rowWithin(int leaf_z, ZRange layers) {
  const int begin = std::clamp(layers.begin - leaf_z, 0, leaf_layers);
  const int end = std::clamp(layers.end - leaf_z, begin, leaf_layers);
  return static_cast<std::uint8_t>((1U << end) - (1U << begin));
}

/// The bits of the values below `limit`, of eight consecutive ones: a row along z.
inline std::uint8_t rowBelow(const float* values, float limit) {
#ifdef __SSE2__
  const __m128 limits = _mm_set1_ps(limit);
  const int low = _mm_movemask_ps(_mm_cmplt_ps(_mm_loadu_ps(values), limits));
  const int high = _mm_movemask_ps(_mm_cmplt_ps(_mm_loadu_ps(values + 4), limits));
  return static_cast<std::uint8_t>(low | high << 4);
#else
  unsigned row = 0;
  for (unsigned n = 0; n < 8; ++n) row |= unsigned{values[n] < limit} << n;
  return static_cast<std::uint8_t>(row);
#endif
}

/// The same for eight consecutive rows.
inline std::uint64_t wordBelow(const float* values, float limit) {
  std::uint64_t word = 0;
  for (unsigned y = 0; y < 8; ++y)
    word |= std::uint64_t{rowBelow(values + 8 * y, limit)} << (8 * y);
  return word;
}

/// V, the plain voxelization: the voxels with d < 0, active or not, at the places in their rows
/// that `row` selects.
inline LeafBits insideBits(const FloatLeaf& leaf, std::uint8_t row) {
  const float* values = leaf.buffer().data();
  LeafBits bits;
  for (unsigned x = 0; x < 8; ++x) bits[x] = wordBelow(values + 64 * x, 0) & everyRow(row);
  return bits;
}

/// The active voxels, at the places in their rows that `row` selects.
inline LeafBits activeBits(const FloatLeaf& leaf, std::uint8_t row) {
  LeafBits bits;
  for (unsigned x = 0; x < 8; ++x)
    bits[x] = leaf.getValueMask().getWord<std::uint64_t>(x) & everyRow(row);
  return bits;
}

/// The active voxels with |d| ≤ `bound`, at the places in their rows that `row` selects.
inline LeafBits bandBits(const FloatLeaf& leaf, float bound, std::uint8_t row) {
  const float* values = leaf.buffer().data();
  const float beyond = std::nextafter(bound, std::numeric_limits<float>::infinity());
  LeafBits bits = activeBits(leaf, row);
  for (unsigned x = 0; x < 8; ++x, values += 64) {
    if (bits[x] != 0) bits[x] &= wordBelow(values, beyond) & ~wordBelow(values, -bound);
  }
  return bits;
}

/// The number of set bits.
inline std::size_t countOf(const LeafBits& bits) {
  std::size_t count = 0;
  for (const std::uint64_t word : bits) count += static_cast<std::size_t>(std::popcount(word));
  return count;
}

/// The rows along z that hold a set bit, as bits in the order of the leaf.
inline std::uint64_t rowsOf(const LeafBits& bits) {
  std::uint64_t rows = 0;
  for (unsigned x = 0; x < bits.size(); ++x) {
    // The lowest bit of each byte that is not zero, and these bits together by a product.
    std::uint64_t any = bits[x] | bits[x] >> 4;
    any |= any >> 2;
    any = (any | any >> 1) & everyRow(1);
    rows |= (any * 0x0102040810204080U) >> 56 << (8 * x);
  }
  return rows;
}

/// Calls `visit(number)` for every set bit, in rising order.
template <typename Visit>
void forEachBit(std::uint64_t word, Visit visit) {
  for (; word != 0; word &= word - 1) visit(static_cast<unsigned>(std::countr_zero(word)));
}

/// Calls `visit(offset)` for every set bit, in rising order of the offset in the leaf.
template <typename Visit>
void forEachBit(const LeafBits& bits, Visit visit) {
  for (unsigned x = 0; x < bits.size(); ++x)
    forEachBit(bits[x], [&](unsigned number) { visit(64 * x + number); });
}

/// Returns the leaves of `tree` that meet `layers`, in the order of the tree.
inline std::vector<const FloatLeaf*> leavesIn(const openvdb::FloatTree& tree, ZRange layers) {
  std::vector<const FloatLeaf*> leaves;
  tree.getNodes(leaves);
  std::erase_if(leaves,
                [&](const FloatLeaf* leaf) { return rowWithin(leaf->origin().z(), layers) == 0; });
  return leaves;
}

/// Makes leaves in parallel and adds them to `tree`. `make_worker()` is called once for each range
/// of sources and returns a function from a leaf of `sources` to a std::unique_ptr of the new leaf,
/// or null for none.
template <typename Tree, typename MakeWorker>
void addLeaves(Tree& tree, std::span<const FloatLeaf* const> sources,
               const MakeWorker& make_worker) {
  std::vector<std::unique_ptr<typename Tree::LeafNodeType>> made(sources.size());
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, sources.size()), [&](const auto& range) {
    auto make = make_worker();
    for (std::size_t n = range.begin(); n != range.end(); ++n) made[n] = make(*sources[n]);
  });
  for (auto& leaf : made) {
    if (leaf) tree.addLeaf(leaf.release());
  }
}

}  // namespace vdbdither
