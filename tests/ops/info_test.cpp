#include <memory>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <openvdb/points/PointDataGrid.h>

#include "io/profile/material_table.h"
#include "io/vdb/vdb.h"
#include "tests/support/drawn_grids.h"
#include "tests/support/scratch_folder.h"
#include "tests/support/sinks.h"

namespace vdbdither {
namespace {

using nlohmann::json;
using openvdb::Coord;
using openvdb::CoordBBox;

std::string told(const Schema& schema, const Grids& grids,
                 const std::vector<std::string>& arguments, int height = 8) {
  const test::SinkCalled info("info", arguments);
  info.run(schema, grids, height);
  return info.said.printed;
}

Schema schemaOf(const Grids& grids, const CoordBBox& box) {
  Schema schema;
  schema.lattice = {{0.5, 0.25, 2}, {0, 0, 0}, box};
  for (const auto& [name, grid] : grids) schema.grids[name] = grid->copyGridWithNewTree();
  schema.metadata[materials_key] =
      toJson({{"white", {240, 240, 240, 255}}, {"black", {26, 26, 29, 255}}});
  schema.metadata["vdbdither:history"] = "drawn\nby hand";
  return schema;
}

TEST(Info, TellsGridsLatticeMaterialsAndHistory) {
  auto surface = openvdb::FloatGrid::create(0.5F);
  surface->setGridClass(openvdb::GRID_LEVEL_SET);
  surface->tree().setValue(Coord(1, 0, 1), -0.25F);
  surface->tree().setValue(Coord(2, 1, 0), 0.125F);
  const Grids grids{{"material", test::drawnMaterial({{"12."}, {".27"}})}, {"surface", surface}};
  EXPECT_EQ(told(schemaOf(grids, {Coord(0), Coord(2, 1, 1)}), grids, {}),
            "lattice   0.5 x 0.25 x 2 mm\n"
            "box       3 x 2 x 2 voxels, 1.5 x 0.5 x 4 mm, from 0 0 0 to 2 1 1\n"
            "material  int32: 4 voxels from 0 0 0 to 2 0 1, values 1 to 7, 2.1 KiB in 1 leaves\n"
            "          1 white: 1 voxels\n"
            "          2 black: 2 voxels\n"
            "          7 (not in the table): 1 voxels\n"
            "surface   float, level set: 2 voxels from 1 0 0 to 2 1 1, values -0.25 to 0.125, 2.1 "
            "KiB in 1 leaves\n"
            "history   drawn\n"
            "          by hand\n");
}

TEST(Info, TellsTheSameForAnySlabs) {
  auto solid = openvdb::BoolGrid::create(false);
  solid->fill(CoordBBox(Coord(-3, 2, 5), Coord(100, 120, 99)), true, true);
  const Grids grids{{"solid", solid}};
  const Schema schema = schemaOf(grids, {Coord(-8, 0, 0), Coord(127)});
  const std::string whole = told(schema, grids, {"--json"}, 128);
  EXPECT_EQ(told(schema, grids, {"--json"}, 8), whole);
  const json found = json::parse(whole);
  EXPECT_EQ(found["grids"][0]["active_voxels"], 104 * 119 * 95);
  EXPECT_EQ(found["grids"][0]["max"], json::parse("[100, 120, 99]"));
  EXPECT_EQ(found["history"], json::parse(R"(["drawn", "by hand"])"));
}

TEST(Info, AnEmptyGridHasNoRange) {
  const Grids grids{{"N", openvdb::Vec3SGrid::create()}};
  const json found = json::parse(told(schemaOf(grids, {Coord(0), Coord(7)}), grids, {"--json"}));
  EXPECT_EQ(found["grids"][0]["type"], "vec3s");
  EXPECT_EQ(found["grids"][0]["active_voxels"], 0);
  EXPECT_FALSE(found["grids"][0].contains("least"));
}

TEST(Info, SaysThatNothingTakesPoints) {
  initializeVdb();
  const test::ScratchFolder scratch;
  const std::string path = scratch / "points.vdb";
  const auto points = openvdb::points::PointDataGrid::create();
  points->setName("points");
  writeVdb(path, {{{"points", points}}, {}}, VdbCodec::mask, path);
  const test::FileToolCalled info("info", {path});
  info.run();
  EXPECT_THAT(info.said.printed, testing::StartsWith("points    ptdataidx32: 0 voxels, "));
  EXPECT_THAT(info.said.printed,
              testing::EndsWith("no operator takes Tree_ptdataidx32_5_4_3; make a level set of it "
                                "first\n"));
}

}  // namespace
}  // namespace vdbdither
