#include <cmath>
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
#include "vdbdither/model/known_grids.h"

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

TEST(Info, TellsTheOriginAndTheBoxOfTheLattice) {
  Schema schema;
  schema.lattice = {{0.5, 0.25, 2}, {0.25, -0.5, 3}, CoordBBox(Coord(-1, -2, -3), Coord(2, 0, 1))};
  EXPECT_EQ(told(schema, {}, {}),
            "lattice   0.5 x 0.25 x 2 mm from 0.25 -0.5 3 mm\n"
            "box       4 x 3 x 5 voxels, 2 x 0.75 x 10 mm, from -1 -2 -3 to 2 0 1\n");
  const json found = json::parse(told(schema, {}, {"--json"}));
  EXPECT_EQ(found["lattice"]["pitch_mm"], json::parse("[0.5, 0.25, 2.0]"));
  EXPECT_EQ(found["lattice"]["origin_mm"], json::parse("[0.25, -0.5, 3.0]"));
  EXPECT_EQ(found["lattice"]["min"], json::parse("[-1, -2, -3]"));
  EXPECT_EQ(found["lattice"]["max"], json::parse("[2, 0, 1]"));
  EXPECT_EQ(found["layers"], 5);
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

/// What `info` says of a file of `contents`, in words or as JSON.
std::string toldOfFile(const VdbContents& contents, std::vector<std::string> arguments = {}) {
  initializeVdb();
  const test::ScratchFolder scratch;
  const std::string path = scratch / "a.vdb";
  writeVdb(path, contents, VdbCodec::mask, path);
  arguments.insert(arguments.begin(), path);
  const test::FileToolCalled info("info", arguments);
  info.run();
  return info.said.printed;
}

TEST(Info, TellsMetadataCutAndWithoutEffectOnATerminal) {
  const auto grid = openvdb::FloatGrid::create();
  grid->setGridClass(openvdb::GRID_FOG_VOLUME);
  grid->insertMeta("author", openvdb::StringMetadata("a\x1b[31m\nhistory   forged"));
  grid->insertMeta("k\ney", openvdb::Int32Metadata(7));
  grid->insertMeta("notes", openvdb::StringMetadata(std::string(5000000, 'x')));
  const VdbContents contents{{{"density", grid}}, {{"scene", "b\xff"}, {history_key, "a\x1b\nb"}}};
  const std::string text = toldOfFile(contents);
  EXPECT_THAT(text, testing::HasSubstr("\nmetadata  scene: b\\xff\n"));
  EXPECT_THAT(text, testing::HasSubstr("\n          author: a\\x1b[31m\\nhistory   forged\n"));
  EXPECT_THAT(text, testing::HasSubstr("\n          k\\ney: 7\n"));
  EXPECT_THAT(text, testing::HasSubstr("\n          notes: " + std::string(100, 'x') +
                                       "... (5000000 bytes)\n"));
  EXPECT_THAT(text, testing::HasSubstr("\nhistory   a\\x1b\n          b\n"));
  const json found = json::parse(toldOfFile(contents, {"--json"}));
  EXPECT_EQ(found["metadata"], json::parse(R"({"scene": "b\\xff"})"));
  const json& of_grid = found["grids"][0]["metadata"];
  EXPECT_EQ(of_grid["author"], "a\x1b[31m\nhistory   forged");
  EXPECT_EQ(of_grid["k\\ney"], "7");
  EXPECT_EQ(of_grid["notes"], std::string(1000, 'x') + "... (5000000 bytes)");
  EXPECT_FALSE(of_grid.contains("name"));
  EXPECT_FALSE(of_grid.contains("class"));
}

TEST(Info, TellsWhatOtherVerbsRefuse) {
  const auto grid = openvdb::FloatGrid::create(1);
  grid->tree().setValue(Coord(1, 2, 3), std::nanf(""));
  const VdbContents contents{{{"surface", grid}}, {}};
  EXPECT_THAT(
      toldOfFile(contents),
      testing::HasSubstr("\n          holds nan at voxel 1 2 3, which is not a finite number"));
  EXPECT_THAT(json::parse(toldOfFile(contents, {"--json"}))["grids"][0]["fault"].get<std::string>(),
              testing::StartsWith("holds nan at voxel 1 2 3"));
}

TEST(Info, TellsTheVoxelsOfPicoGk) {
  const auto grid = openvdb::FloatGrid::create(3);
  grid->setGridClass(openvdb::GRID_LEVEL_SET);
  grid->insertMeta("PicoGK.VoxelSize", openvdb::FloatMetadata(0.0002F));
  const VdbContents contents{{{"ball", grid}}, {}};
  const std::string text = toldOfFile(contents);
  EXPECT_THAT(text, testing::HasSubstr("PicoGK: voxels of 0.2 mm by its metadata"));
  EXPECT_THAT(text, testing::HasSubstr("vdbdither resample "));
  EXPECT_THAT(text, testing::Not(testing::HasSubstr("vdbdither read ")));
  EXPECT_EQ(json::parse(toldOfFile(contents, {"--json"}))["grids"][0]["place"], "picogk");
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
  EXPECT_THAT(info.said.printed, testing::StartsWith("points    ptdataidx32: voxels not read\n"));
  EXPECT_THAT(info.said.printed,
              testing::EndsWith("no operator takes Tree_ptdataidx32_5_4_3; make a level set of it "
                                "first\n"));
}

}  // namespace
}  // namespace vdbdither
