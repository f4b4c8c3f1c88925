#include "ops/kernels/leaf/leaf_surroundings.h"

#include <random>

#include <gtest/gtest.h>

namespace vdbdither {
namespace {

using openvdb::Coord;
using openvdb::FloatTree;

/// Leaves with some inactive voxels, tiles of either sign, one of them active, and gaps.
FloatTree patchedTree() {
  FloatTree tree(5.0F);
  std::mt19937 random(11);
  std::uniform_real_distribution<float> distance(-4, 4);
  for (int x = -16; x < 16; x += 8) {
    for (int y = -16; y < 16; y += 8) {
      for (int z = -16; z < 16; z += 8) {
        const Coord origin(x, y, z);
        const unsigned kind = random() % 8;
        if (kind == 0) continue;
        if (kind == 1) {
          tree.addTile(1, origin, -5.0F, false);
        } else if (kind == 2) {
          tree.addTile(1, origin, distance(random), true);
        } else {
          auto* leaf = tree.touchLeaf(origin);
          for (openvdb::Index n = 0; n < 512; ++n) {
            const float d = distance(random);
            leaf->setValueOnly(n, d);
            leaf->setActiveState(n, kind == 3 || random() % 2 == 0);
          }
        }
      }
    }
  }
  return tree;
}

/// All voxels of a leaf, or one, or two somewhere, by turns.
LeafBits someRows(int turn) {
  LeafBits bits{};
  if (turn % 3 == 0) {
    bits.fill(~std::uint64_t{0});
  } else {
    std::mt19937 random(static_cast<unsigned>(turn));
    for (int n = 0; n < turn % 3; ++n) bits[random() % 8] |= std::uint64_t{1} << (random() % 64);
  }
  return bits;
}

TEST(LeafSurroundings, AreWhatTheTreeHoldsUpToTwoVoxelsAway) {
  const FloatTree tree = patchedTree();
  for (const ZRange valid : {ZRange{-100, 100}, ZRange{-8, 8}, ZRange{-5, 3}}) {
    LeafSurroundings around(tree, valid);
    int leaves = 0;
    for (auto leaf = tree.cbeginLeaf(); leaf; ++leaf, ++leaves) {
      const LeafBits wanted = someRows(leaves);
      around.visit(*leaf, wanted);
      for (unsigned offset = 0; offset < 512; ++offset) {
        if ((wanted[offset / 64] >> (offset % 64) & 1U) == 0) continue;
        const float* at = around.at(offset);
        for (int i = -LeafSurroundings::halo; i <= LeafSurroundings::halo; ++i) {
          for (int j = -LeafSurroundings::halo; j <= LeafSurroundings::halo; ++j) {
            for (int k = -LeafSurroundings::halo; k <= LeafSurroundings::halo; ++k) {
              const Coord ijk = leaf->offsetToGlobalCoord(offset).offsetBy(i, j, k);
              float expected = tree.getValue(ijk);
              if (!valid.contains(ijk.z())) {
                expected = std::numeric_limits<float>::infinity();
              } else if (!tree.isValueOn(ijk)) {
                expected = std::copysign(std::numeric_limits<float>::infinity(), expected);
              }
              ASSERT_EQ(at[i * LeafSurroundings::stride_x + j * LeafSurroundings::stride_y +
                           k * LeafSurroundings::stride_z],
                        expected)
                  << ijk << " from " << leaf->origin();
            }
          }
        }
      }
    }
    EXPECT_GT(leaves, 20);
  }
}

}  // namespace
}  // namespace vdbdither
