#include "ops/kernels/measure/grid_summary.h"

#include <gtest/gtest.h>

namespace vdbdither {
namespace {

using openvdb::Coord;
using openvdb::CoordBBox;

TEST(GridSummary, CountsVoxelsOfLeavesAndTiles) {
  auto grid = openvdb::Int32Grid::create(0);
  grid->tree().addTile(1, Coord(8, 0, 0), 3, true);
  grid->tree().addTile(1, Coord(32, 0, 0), 9, false);
  grid->tree().setValue(Coord(-1, 2, 3), -4);
  grid->tree().setValue(Coord(-2, 2, 3), 3);
  const GridSummary summary = gridSummary(*grid);
  EXPECT_EQ(summary.active_voxels, 514U);
  EXPECT_EQ(summary.box, CoordBBox(Coord(-2, 0, 0), Coord(15, 7, 7)));
  EXPECT_EQ(summary.minimum[0], -4);
  EXPECT_EQ(summary.maximum[0], 3);
  EXPECT_EQ(summary.leaves, 1U);
  EXPECT_EQ(summary.counts, (std::map<std::int64_t, std::uint64_t>{{-4, 1}, {3, 513}}));
}

TEST(GridSummary, VectorsHaveARangeForEachComponent) {
  auto grid = openvdb::Vec3SGrid::create();
  grid->tree().setValue(Coord(0), openvdb::Vec3s(1, -2, 0));
  grid->tree().setValue(Coord(1), openvdb::Vec3s(-3, 5, 0.5F));
  const GridSummary summary = gridSummary(*grid);
  EXPECT_EQ(summary.minimum, openvdb::Vec3d(-3, -2, 0));
  EXPECT_EQ(summary.maximum, openvdb::Vec3d(1, 5, 0.5));
}

TEST(GridSummary, LayersAddUpAndEmptyOnesAddNothing) {
  auto low = openvdb::FloatGrid::create(7);
  low->tree().setValue(Coord(0), 2);
  auto high = openvdb::FloatGrid::create(7);
  high->tree().setValue(Coord(0, 0, 9), -1);
  GridSummary all;
  all.add(gridSummary(*low));
  all.add(gridSummary(*openvdb::FloatGrid::create(7)));
  all.add(gridSummary(*high));
  EXPECT_EQ(all.active_voxels, 2U);
  EXPECT_EQ(all.minimum[0], -1);
  EXPECT_EQ(all.maximum[0], 2);
  EXPECT_EQ(all.box, CoordBBox(Coord(0), Coord(0, 0, 9)));
}

}  // namespace
}  // namespace vdbdither
