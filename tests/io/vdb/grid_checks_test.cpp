#include "io/vdb/grid_checks.h"

#include <cmath>
#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "io/vdb/vdb.h"
#include "vdbdither/model/errors.h"
#include "vdbdither/model/openvdb.h"

namespace vdbdither {
namespace {

using openvdb::Coord;
using openvdb::CoordBBox;
using openvdb::FloatGrid;
using testing::Optional;
using testing::StartsWith;
using testing::ThrowsMessage;

const float nan = std::numeric_limits<float>::quiet_NaN();
const float infinity = std::numeric_limits<float>::infinity();

class GridChecks : public testing::Test {
 protected:
  void SetUp() override { initializeVdb(); }
};

TEST_F(GridChecks, SoundGridsOfAllTypesPass) {
  const auto surface = FloatGrid::create(0.5F);
  surface->setGridClass(openvdb::GRID_LEVEL_SET);
  surface->fill(CoordBBox(Coord(-20), Coord(20)), -0.25F);
  EXPECT_FALSE(faultOf(*surface));
  const auto fog = FloatGrid::create(-1);
  EXPECT_FALSE(faultOf(*fog));
  EXPECT_FALSE(faultOf(*openvdb::BoolGrid::create(true)));
  EXPECT_FALSE(faultOf(*openvdb::Int32Grid::create(-1)));
  EXPECT_FALSE(faultOf(*openvdb::Vec3SGrid::create()));
  EXPECT_FALSE(faultOf(*openvdb::Vec3IGrid::create()));
}

TEST_F(GridChecks, TheFirstVoxelThatIsNotFiniteIsNamed) {
  const auto grid = FloatGrid::create(0.5F);
  for (int i = 0; i < 2000; ++i) grid->tree().setValue(Coord(8 * i, 3, -7), 0.1F);
  grid->tree().setValueOnly(Coord(12003, 4, -1), -infinity);
  grid->tree().setValue(Coord(9001, 3, -7), nan);
  EXPECT_THAT(faultOf(*grid),
              Optional(std::string("holds nan at voxel 9001 3 -7, which is not a finite number; "
                                   "mend it in the tool that it comes from")));
  grid->tree().setValue(Coord(9001, 3, -7), 1);
  EXPECT_THAT(faultOf(*grid), Optional(StartsWith("holds -inf at voxel 12003 4 -1, ")));
}

TEST_F(GridChecks, TilesBackgroundsAndVectorsAreCheckedToo) {
  const auto tiles = FloatGrid::create(0.5F);
  tiles->sparseFill(CoordBBox(Coord(128), Coord(255)), infinity);
  EXPECT_THAT(faultOf(*tiles), Optional(StartsWith("holds inf at voxel 128 128 128, ")));
  EXPECT_THAT(faultOf(*openvdb::DoubleGrid::create(std::nan(""))),
              Optional(StartsWith("holds nan as its background, ")));
  const auto normals = openvdb::Vec3SGrid::create();
  normals->tree().setValue(Coord(1, 2, 3), openvdb::Vec3s(0, nan, 1));
  EXPECT_THAT(faultOf(*normals), Optional(StartsWith("holds (0 nan 1) at voxel 1 2 3, ")));
}

TEST_F(GridChecks, ALevelSetThatIsInsideEverywhereIsRefused) {
  const auto grid = FloatGrid::create(-1);
  grid->setGridClass(openvdb::GRID_LEVEL_SET);
  Grids grids{{"surface", grid}};
  EXPECT_THAT(
      [&] { admitGrids(grids, "'part.vdb'"); },
      ThrowsMessage<DataError>(
          "'part.vdb': grid 'surface' holds distances with the background -1, so that "
          "everything beyond its voxels is inside; mend it in the tool that it comes from"));
}

TEST_F(GridChecks, VoxelsAreInOnlyWhereTheyAreActiveAndTrue) {
  const auto solid = openvdb::BoolGrid::create(false);
  solid->setName("solid");
  solid->tree().fill(openvdb::CoordBBox(Coord(0), Coord(39)), false, true);
  solid->tree().setValueOn(Coord(3, 4, 5), true);
  solid->tree().setValueOn(Coord(100, 0, 0), true);
  Grids grids{{"solid", solid}};
  admitGrids(grids, "'part.vdb'");
  const auto voxels = openvdb::GridBase::grid<openvdb::BoolGrid>(grids.at("solid"));
  EXPECT_EQ(voxels->activeVoxelCount(), 2U);
  EXPECT_TRUE(voxels->tree().isValueOn(Coord(3, 4, 5)));
  EXPECT_TRUE(voxels->tree().isValueOn(Coord(100, 0, 0)));
  EXPECT_EQ(voxels->getName(), "solid");
  EXPECT_EQ(solid->activeVoxelCount(), 64001U) << "the grid that was given stays";
  // A grid without such voxels is not copied.
  const GridConstPtr sound = grids.at("solid");
  admitGrids(grids, "'part.vdb'");
  EXPECT_EQ(grids.at("solid"), sound);
}

TEST_F(GridChecks, VoxelsThatAreInEverywhereBeyondAreRefused) {
  const auto solid = openvdb::BoolGrid::create(true);
  solid->setName("solid");
  EXPECT_THAT(faultOf(*solid),
              Optional(StartsWith("has the background true, so that everything beyond its voxels "
                                  "is in; ")));
}

TEST_F(GridChecks, DistancesWithoutAClassAreCheckedByTheirName) {
  const auto grid = FloatGrid::create(-1);
  EXPECT_FALSE(faultOf(*grid));
  grid->setName("surface");
  EXPECT_THAT(faultOf(*grid), Optional(StartsWith("holds distances with the background -1, ")));
  grid->setGridClass(openvdb::GRID_FOG_VOLUME);
  EXPECT_FALSE(faultOf(*grid));
}

TEST_F(GridChecks, IndicesThatBoxesCannotCountAreTold) {
  EXPECT_TRUE(isCountable(Coord(1 << 30, -(1 << 30), 0)));
  EXPECT_FALSE(isCountable(Coord(0, (1 << 30) + 1, 0)));
  EXPECT_FALSE(isCountable(Coord(0, 0, std::numeric_limits<int>::min())));
}

}  // namespace
}  // namespace vdbdither
