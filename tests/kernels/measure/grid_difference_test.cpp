#include "ops/kernels/measure/grid_difference.h"

#include <cmath>
#include <limits>

#include <gtest/gtest.h>

namespace vdbdither {
namespace {

using openvdb::Coord;
using openvdb::CoordBBox;
using openvdb::FloatGrid;

TEST(GridDifference, EqualGridsHaveNoneHoweverTheirTreesAreBuilt) {
  auto tiles = FloatGrid::create(1);
  tiles->tree().addTile(2, Coord(0), -1, true);
  auto voxels = FloatGrid::create(1);
  voxels->denseFill(CoordBBox(Coord(0), Coord(127)), -1, true);
  EXPECT_EQ(gridDifference(*tiles, *voxels, 0).voxels, 0U);
  EXPECT_EQ(gridDifference(*voxels, *tiles, 0).voxels, 0U);
}

TEST(GridDifference, FindsTheLowestVoxelTheCountAndTheLargest) {
  auto a = FloatGrid::create(1);
  a->fill(CoordBBox(Coord(0), Coord(20)), 0.5F);
  auto b = a->deepCopy();
  b->tree().setValue(Coord(3, 9, 7), 0.75F);
  b->tree().setValue(Coord(20, 2, 7), 2.5F);
  b->tree().setValue(Coord(0, 0, 8), 0.5625F);
  const GridDifference found = gridDifference(*a, *b, 0);
  EXPECT_EQ(found.voxels, 3U);
  EXPECT_EQ(found.first, Coord(20, 2, 7));
  EXPECT_EQ(found.largest, 2.0);
  EXPECT_EQ(gridDifference(*a, *b, 0.25).voxels, 1U);
}

TEST(GridDifference, CountsTheVoxelsOfTilesAndTheStates) {
  auto a = openvdb::BoolGrid::create(false);
  auto b = a->deepCopy();
  b->tree().addTile(1, Coord(-8, 16, 8), true, true);
  GridDifference found = gridDifference(*a, *b, 0);
  EXPECT_EQ(found.voxels, 512U);
  EXPECT_EQ(found.first, Coord(-8, 16, 8));
  EXPECT_EQ(found.largest, 1);
  a->tree().addTile(1, Coord(-8, 16, 8), true, false);
  found = gridDifference(*a, *b, 0);
  EXPECT_EQ(found.voxels, 512U);
  EXPECT_EQ(found.largest, 0);
}

TEST(GridDifference, NanEqualsNanAndNothingElse) {
  auto a = FloatGrid::create(1);
  a->tree().setValue(Coord(1, 2, 3), std::numeric_limits<float>::quiet_NaN());
  auto b = a->deepCopy();
  EXPECT_EQ(gridDifference(*a, *b, 0).voxels, 0U);
  b->tree().setValue(Coord(1, 2, 3), 0);
  const GridDifference found = gridDifference(*a, *b, 1e30);
  EXPECT_EQ(found.voxels, 1U);
  EXPECT_TRUE(std::isinf(found.largest));
}

TEST(GridDifference, VectorsDifferByTheirFurthestComponent) {
  auto a = openvdb::Vec3SGrid::create();
  auto b = a->deepCopy();
  a->tree().setValue(Coord(0), openvdb::Vec3s(1, 0, 0));
  b->tree().setValue(Coord(0), openvdb::Vec3s(1, 0.5F, -2));
  EXPECT_EQ(gridDifference(*a, *b, 0).largest, 2);
}

TEST(GridDifference, SumsKeepTheLowestFirst) {
  GridDifference all;
  all.add({2, Coord(5, 5, 5), 1});
  all.add({});
  all.add({3, Coord(9, 4, 5), 0.5});
  EXPECT_EQ(all.voxels, 5U);
  EXPECT_EQ(all.first, Coord(9, 4, 5));
  EXPECT_EQ(all.largest, 1);
}

}  // namespace
}  // namespace vdbdither
