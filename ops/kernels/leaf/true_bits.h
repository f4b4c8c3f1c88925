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

/// The same of the leaf of `solid` at `origin`, or of the tile in its place.
inline LeafBits trueBits(const openvdb::tree::ValueAccessor<const openvdb::BoolTree, false>& solid,
                         const openvdb::Coord& origin) {
  if (const auto* leaf = solid.probeConstLeaf(origin)) return trueBits(*leaf);
  bool value = false;
  LeafBits bits;
  bits.fill(solid.probeValue(origin, value) && value ? ~std::uint64_t{0} : 0);
  return bits;
}

/// The same of those in the layers `valid`.
inline LeafBits trueBits(const openvdb::tree::ValueAccessor<const openvdb::BoolTree, false>& solid,
                         const openvdb::Coord& origin, ZRange valid) {
  const std::uint8_t row = rowWithin(origin.z(), valid);
  if (row == 0) return no_bits;
  LeafBits bits = trueBits(solid, origin);
  for (std::uint64_t& word : bits) word &= everyRow(row);
  return bits;
}

}  // namespace vdbdither
