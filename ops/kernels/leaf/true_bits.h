#pragma once

#include "ops/kernels/leaf/leaf_bits.h"

namespace vdbdither {

/// The voxels of a leaf of a grid of bits that are active and true.
inline LeafBits trueBits(const openvdb::BoolTree::LeafNodeType& leaf) {
  LeafBits bits;
  for (unsigned x = 0; x < bits.size(); ++x)
    bits[x] = leaf.getValueMask().getWord<std::uint64_t>(x) & leaf.buffer().data()[x];
  return bits;
}

}  // namespace vdbdither
