#include "ops/kernels/dither/block_order.h"

#include <gtest/gtest.h>

namespace vdbdither {
namespace {

using openvdb::Coord;

TEST(BlockOrder, BlocksHoldTheReachAndWholeLeaves) {
  EXPECT_EQ(BlockOrder(Coord(3, 1, 6)).edges(), Coord(16, 16, 8));
  EXPECT_EQ(BlockOrder(Coord(9, 8, 9)).edges(), Coord(16, 16, 16));
  EXPECT_EQ(BlockOrder(Coord(0, 0, 0)).edges(), Coord(16, 16, 8));
}

TEST(BlockOrder, IndicesAreAbsoluteAlsoBelowZero) {
  const BlockOrder order(Coord(3, 3, 3));
  EXPECT_EQ(order.blockOf({0, 15, 7}), Coord(0, 0, 0));
  EXPECT_EQ(order.blockOf({-1, -16, -8}), Coord(-1, -1, -1));
  EXPECT_EQ(order.blockOf({-17, 16, -9}), Coord(-2, 1, -2));
}

TEST(BlockOrder, TheParityAlongZIsTheOutermost) {
  EXPECT_LT(BlockOrder::colourOf({1, 1, 2}), BlockOrder::colourOf({0, 0, 1}));
  EXPECT_LT(BlockOrder::colourOf({1, 0, -2}), BlockOrder::colourOf({0, 1, 4}));
  EXPECT_EQ(BlockOrder::colourOf({-1, -1, -1}), 7);
}

TEST(BlockOrder, AnOddLayerNeedsTheEvenOnesBesideIt) {
  const BlockOrder order(Coord(3, 3, 3));
  EXPECT_EQ(order.needed({0, 8}), (ZRange{0, 8}));
  EXPECT_EQ(order.needed({8, 16}), (ZRange{0, 24}));
  EXPECT_EQ(order.needed({0, 64}), (ZRange{0, 72}));
  EXPECT_EQ(order.needed({-8, 3}), (ZRange{-16, 8}));
}

TEST(BlockOrder, TheReachCoversWhatACoreOfWholeLeavesNeeds) {
  for (const int reach : {1, 8, 9, 16}) {
    const BlockOrder order((Coord(reach)));
    for (int sweeps = 1; sweeps <= 3; ++sweeps) {
      int most = 0;
      for (int begin = -64; begin <= 64; begin += 8) {
        for (int end = begin + 8; end <= 80; end += 8) {
          const ZRange needed = order.needed({begin, end}, sweeps);
          most = std::max({most, begin - needed.begin, needed.end - end});
        }
      }
      EXPECT_EQ(most, order.reachLayers(sweeps)) << reach << " " << sweeps;
    }
  }
}

}  // namespace
}  // namespace vdbdither
