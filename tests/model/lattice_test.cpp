#include "vdbdither/model/lattice.h"

#include <gtest/gtest.h>

namespace vdbdither {
namespace {

TEST(Lattice, WithoutVoxelsHasNoLayers) {
  EXPECT_EQ(Lattice{}.layers(), (ZRange{0, 0}));
  EXPECT_EQ((Lattice{{1, 1, 1}, {0, 0, 0}, openvdb::CoordBBox()}).layers().size(), 0);
}

TEST(Lattice, AlignsRangesOutwardsToLeavesAlsoBelowZero) {
  EXPECT_EQ(alignedToLeaves({-3, 5}), (ZRange{-8, 8}));
  EXPECT_EQ(alignedToLeaves({8, 16}), (ZRange{8, 16}));
  EXPECT_EQ(alignedToLeaves({-16, -15}), (ZRange{-16, -8}));
  EXPECT_TRUE(alignedToLeaves({4, 4}).empty());
}

TEST(Lattice, IntersectionOfDistantRangesIsEmpty) {
  EXPECT_EQ(intersection({0, 10}, {5, 20}), (ZRange{5, 10}));
  EXPECT_TRUE(intersection({0, 4}, {6, 9}).empty());
}

TEST(Lattice, PositionIsTheCentreOfTheVoxelInMillimetres) {
  const Lattice lattice{{0.042, 0.084, 0.022}, {0.0, -0.021, 0.0}, {}};
  EXPECT_DOUBLE_EQ(lattice.position({2, 1, -3}).x(), 0.084);
  EXPECT_DOUBLE_EQ(lattice.position({2, 1, -3}).y(), 0.063);
  EXPECT_DOUBLE_EQ(lattice.position({2, 1, -3}).z(), -0.066);
}

}  // namespace
}  // namespace vdbdither
