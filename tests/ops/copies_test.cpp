#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/filters.h"
#include "tests/support/told.h"
#include "vdbdither/model/errors.h"

namespace vdbdither {
namespace {

using openvdb::BoolGrid;
using openvdb::Coord;
using openvdb::CoordBBox;
using openvdb::FloatGrid;
using openvdb::Vec3d;
using testing::HasSubstr;
using testing::ThrowsMessage;

const Vec3d pitch_mm(0.1, 0.2, 0.05);

/// A ball with its inside as tiles, on a lattice whose box begins within a leaf.
Schema ball() {
  const Lattice lattice{pitch_mm, Vec3d(0.0), CoordBBox(Coord(-13, -7, -26), Coord(13, 7, 26))};
  return test::schemaOf(lattice,
                        {{"surface", test::sampled(test::sphere(Vec3d(0.0), 1.2), lattice, 0.2)}});
}

/// Every voxel of `surface` that the filter makes in slabs of that height, value and state.
std::map<Coord, std::pair<float, bool>> made(Filter& filter, const Schema& schema, int height) {
  const CoordBBox box = filter.plan(schema).lattice.box;
  std::map<Coord, std::pair<float, bool>> voxels;
  for (const auto& [core, grids] : test::runInSlabs(filter, schema, height)) {
    const auto grid = openvdb::gridConstPtrCast<FloatGrid>(grids.at("surface"));
    for (auto v = box.begin(); v; ++v) {
      if ((*v).z() < core.begin || (*v).z() >= core.end) continue;
      voxels[*v] = {grid->tree().getValue(*v), grid->tree().isValueOn(*v)};
    }
  }
  return voxels;
}

TEST(Copies, AreThePartAgainAndAgainAtDistancesOfWholeLeaves) {
  const Schema schema = ball();
  const auto part = openvdb::gridConstPtrCast<FloatGrid>(schema.grids.at("surface"));
  ASSERT_TRUE(part->tree().hasActiveTiles() || part->tree().getValue(Coord(0)) < 0);
  const auto copies =
      test::filterCalled("copies", {"--columns", "3", "--rows", "2", "--gap", "0.3"});
  // With the gap, the box takes 30 x 17 voxels, and its leaves 32 x 16.
  const CoordBBox box = copies->plan(schema).lattice.box;
  EXPECT_EQ(box, CoordBBox(Coord(-13, -7, -26), Coord(13 + 2 * 32, 7 + 24, 26)));
  for (const int height : {8, 16, 64}) {
    const auto voxels = made(*copies, schema, height);
    int inside = 0;
    for (const auto& [voxel, value] : voxels) {
      Coord within = voxel;
      for (int column = 0; column < 2 && within.x() > 16; ++column) within.x() -= 32;
      if (within.y() > 12) within.y() -= 24;
      ASSERT_EQ(value.first, part->tree().getValue(within)) << voxel;
      ASSERT_EQ(value.second, part->tree().isValueOn(within)) << voxel;
      inside += value.first < 0;
    }
    EXPECT_GT(inside, 6 * 500) << height;
  }
}

TEST(Copies, KeepTheGapBetweenBoxes) {
  const Schema schema = ball();
  for (const double gap_mm : {0.0, 0.1, 0.8, 0.81, 3.0}) {
    const auto copies =
        test::filterCalled("copies", {"--columns", "2", "--gap", std::to_string(gap_mm)});
    const CoordBBox box = copies->plan(schema).lattice.box;
    const int free = box.dim().x() - 2 * schema.lattice.box.dim().x();
    EXPECT_GE(free * pitch_mm.x(), gap_mm - 1e-9);
    EXPECT_LT(free * pitch_mm.x(), gap_mm + 1.5) << gap_mm;
  }
}

TEST(Copies, AreCountedByTheEstimates) {
  Schema schema = ball();
  schema.footprint = {10, 100, 80};
  const auto copies = test::filterCalled("copies", {"--columns", "3", "--rows", "2"});
  EXPECT_EQ(copies->plan(schema).footprint, (Footprint{60, 600, 480}));
}

TEST(Copies, RefuseAnEmptyLatticeAndOneWithoutEnd) {
  Schema schema = ball();
  const std::vector<std::string> many{"--columns", "10000"};
  EXPECT_THAT(test::planning(
                  "copies",
                  [&] {
                    Schema wide = schema;
                    wide.lattice.box.max().x() = 1 << 20;
                    return wide;
                  }(),
                  many),
              ThrowsMessage<UsageError>(HasSubstr("--columns: 10000 copies reach beyond")));
  schema.lattice.box = CoordBBox();
  EXPECT_THAT(test::planning("copies", schema, many),
              ThrowsMessage<DataError>(HasSubstr("there is nothing to copy")));
}

}  // namespace
}  // namespace vdbdither
