#include <filesystem>
#include <fstream>
#include <memory>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "io/file/staged_output.h"
#include "io/image/png_spans.h"
#include "io/profile/material_table.h"
#include "io/vdb/vdb.h"
#include "tests/support/drawn_grids.h"
#include "tests/support/scratch_folder.h"
#include "tests/support/sinks.h"
#include "tests/support/slabs.h"
#include "tests/support/span_images.h"
#include "tests/support/told.h"
#include "vdbdither/engine/registry.h"
#include "vdbdither/model/errors.h"
#include "vdbdither/model/layers.h"

namespace vdbdither {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;
using openvdb::Coord;
using openvdb::CoordBBox;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;
using testing::ThrowsMessage;

struct Job {
  Schema schema;
  Grids grids;
};

/// Balls and boxes of three materials, with tiles of more than a leaf.
Job job() {
  Job job;
  const CoordBBox box(Coord(-21, -3, -11), Coord(160, 150, 29));
  job.schema.lattice = {{0.042, 0.084, 0.022}, {0, 0, 0}, box};
  auto material = openvdb::Int32Grid::create(0);
  material->setTransform(std::make_shared<openvdb::math::Transform>(
      std::make_shared<openvdb::math::ScaleMap>(job.schema.lattice.pitch_mm)));
  material->fill(CoordBBox(Coord(0, 0, -8), Coord(150, 140, 25)), 3);
  for (auto voxel = CoordBBox(Coord(-20, -3, -11), Coord(40, 30, 29)).begin(); voxel; ++voxel) {
    if (((*voxel).asVec3d() - openvdb::Vec3d(10, 14, 9)).length() < 15)
      material->tree().setValue(*voxel, (*voxel).x() < 12 ? 1 : 2);
  }
  job.grids["material"] = pruned(material);
  job.schema.grids["material"] = material->copyGridWithNewTree();
  job.schema.metadata[materials_key] = toJson(
      {{"white", {240, 240, 240, 255}}, {"black", {26, 26, 29, 255}}, {"red", {255, 0, 0, 255}}});
  job.schema.metadata["vdbdither:history"] = "drawn\nby hand";
  return job;
}

void exported(const Job& job, const std::vector<std::string>& arguments) {
  test::SinkCalled("slice-export", arguments).run(job.schema, job.grids);
}

struct Import {
  explicit Import(const std::string& path, bool edited = false)
      : made(findOperator("slice-import").make()) {
    Options options;
    made->declare(options);
    std::vector<std::string> arguments{path};
    if (edited) arguments.emplace_back("--edited");
    options.parse(arguments);
    made->setReporter(&listener);
  }
  Source& source() { return static_cast<Source&>(*made); }

  std::unique_ptr<Operator> made;
  test::Listener listener;
};

/// The bytes of an archive of the grid, which tell grids apart that differ in anything.
std::string bytesOf(const GridConstPtr& grid) {
  return archiveBytes({{{"grid", pruned(grid)}}, {}}, VdbCodec::none);
}

GridConstPtr solidOf(const GridConstPtr& material) {
  const auto values = openvdb::gridConstPtrCast<openvdb::Int32Grid>(material);
  const auto solid = test::solidOf(*values);
  solid->setTransform(values->transform().copy());
  return solid;
}

class SliceImport : public testing::Test {
 protected:
  void SetUp() override { initializeVdb(); }

  void expectRoundTrip(const Job& job, const std::vector<std::string>& more, bool material = true,
                       const std::string& name = "out") {
    const test::ScratchFolder scratch;
    std::vector<std::string> arguments = {scratch / name};
    arguments.insert(arguments.end(), more.begin(), more.end());
    exported(job, arguments);
    Import import(scratch / name);
    const Schema schema = import.source().plan();
    EXPECT_EQ(schema.lattice, job.schema.lattice);
    EXPECT_EQ(schema.grids.contains("material"), material);
    EXPECT_EQ(schema.metadata.at("vdbdither:history"), "drawn\nby hand");
    if (material) {
      EXPECT_EQ(schema.metadata.at(materials_key), job.schema.metadata.at(materials_key));
    }
    const ZRange layers = schema.lattice.layers();
    for (const int height : {8, 64}) {
      std::map<std::string, std::vector<GridLayers>> pieces;
      for (int z = alignedToLeaves(layers).begin; z < layers.end; z += height) {
        const ZRange core = intersection({z, z + height}, layers);
        for (const auto& [grid_name, grid] : import.source().run(core))
          pieces[grid_name].push_back({grid, core});
      }
      if (material) {
        EXPECT_TRUE(bytesOf(joinLayers(pieces["material"], layers)) ==
                    bytesOf(job.grids.at("material")));
      }
      EXPECT_TRUE(bytesOf(joinLayers(pieces["solid"], layers)) ==
                  bytesOf(solidOf(job.grids.at("material"))));
    }
    EXPECT_THAT(import.listener.warnings, IsEmpty());
  }

  test::ScratchFolder scratch_;
};

TEST_F(SliceImport, GivesBackWhatWasExportedAsColours) { expectRoundTrip(job(), {}); }
TEST_F(SliceImport, GivesBackWhatWasExportedAsBits) {
  expectRoundTrip(job(), {"--format", "png1"});
}
TEST_F(SliceImport, GivesBackTheSolidOfGrey) {
  expectRoundTrip(job(), {"--format", "png8"}, false);
}
TEST_F(SliceImport, GivesBackWhatWasExportedAsTiff) {
  expectRoundTrip(job(), {"--format", "tiff"});
  expectRoundTrip(job(), {"--format", "tiff1"});
}
TEST_F(SliceImport, GivesBackWhatWasExportedAsExr) {
  expectRoundTrip(job(), {"--format", "exr"});
  expectRoundTrip(job(), {"--format", "exr", "--exr-packing", "piz", "--exr-tile", "32"});
  expectRoundTrip(job(), {"--format", "exr", "--exr-packing", "zip"});
}
TEST_F(SliceImport, GivesBackWhatWasExportedIntoAZip) {
  expectRoundTrip(job(), {}, true, "out.zip");
}
TEST_F(SliceImport, KnowsPaddingOrientationNumbersAndBackground) {
  expectRoundTrip(job(), {"--padding", "5", "--flip-x", "--flip-y", "--first", "7", "--prefix", "p",
                          "--background", "1,2,3,0"});
}

TEST_F(SliceImport, AStackOfSolidHasNoMaterials) {
  const Job materials = job();
  Job solid = materials;
  solid.grids = {{"solid", solidOf(materials.grids.at("material"))}};
  solid.schema.grids = {{"solid", openvdb::BoolGrid::create(false)}};
  exported(solid, {scratch_ / "out"});
  Import import(scratch_ / "out/manifest.json");
  const Schema schema = import.source().plan();
  EXPECT_FALSE(schema.grids.contains("material"));
  EXPECT_TRUE(bytesOf(import.source().run(schema.lattice.layers()).at("solid")) ==
              bytesOf(solidOf(materials.grids.at("material"))));
}

TEST_F(SliceImport, TakesSlicesThatWereEditedOnDemandAndWarnsOnce) {
  exported(job(), {scratch_ / "out", "--keep-blank"});
  const SpanImage blank = test::spanImage(182, 154, [](int, int) { return 0U; });
  const std::vector<std::uint32_t> palette = {rgba(0, 0, 0)};
  for (const char* name : {"out/slice_00003.png", "out/slice_00004.png"})
    writeFile(scratch_ / name, encodePng(blank, {PngPixels::rgba8, palette, 0, 0}), name);
  EXPECT_THAT(
      [&] {
        Import strict(scratch_ / "out");
        static_cast<void>(strict.source().run(strict.source().plan().lattice.layers()));
      },
      ThrowsMessage<DataError>(HasSubstr(
          " was changed after slice-export wrote it: its digest differs; make the stack again with "
          "slice-export, or give --edited to take it as it is")));
  Import import(scratch_ / "out", true);
  const Schema schema = import.source().plan();
  const auto solid = import.source().run(schema.lattice.layers()).at("solid");
  EXPECT_FALSE(openvdb::gridConstPtrCast<openvdb::BoolGrid>(solid)->tree().isValueOn({10, 14, -8}));
  EXPECT_TRUE(openvdb::gridConstPtrCast<openvdb::BoolGrid>(solid)->tree().isValueOn({10, 14, 0}));
  ASSERT_THAT(import.listener.warnings, SizeIs(1));
  EXPECT_THAT(import.listener.warnings[0], HasSubstr("its digest differs; it is taken as it is"));
}

TEST_F(SliceImport, DeclaresTheStackAsAnInput) {
  exported(job(), {scratch_ / "out"});
  Import import(scratch_ / "out");
  const Schema schema = import.source().plan();
  const std::vector<Input*> inputs = import.source().inputs();
  ASSERT_THAT(inputs, SizeIs(1));
  EXPECT_EQ(inputs[0]->path(), scratch_ / "out");
  EXPECT_FALSE(inputs[0]->isPipe());
  EXPECT_EQ(inputs[0]->schema().lattice, schema.lattice);
}

TEST_F(SliceImport, RefusesAStackThatIsNoneOrLacksSlices) {
  EXPECT_THAT(
      [&] { Import(scratch_ / "gone").source().plan(); },
      ThrowsMessage<DataError>("no such file or folder '" + (scratch_ / "gone").string() + "'"));
  fs::create_directory(scratch_ / "empty");
  EXPECT_THAT([&] { Import(scratch_ / "empty").source().plan(); },
              ThrowsMessage<DataError>(
                  HasSubstr("holds no manifest.json, so it is not a stack made by slice-export")));
  std::ofstream(scratch_ / "empty/manifest.json") << "{}";
  EXPECT_THAT([&] { Import(scratch_ / "empty").source().plan(); },
              ThrowsMessage<DataError>(HasSubstr("is not a manifest of slice-export: ")));
  exported(job(), {scratch_ / "out", "--keep-blank"});
  fs::remove(scratch_ / "out/slice_00012.png");
  EXPECT_THAT([&] { Import(scratch_ / "out").source().plan(); },
              ThrowsMessage<DataError>("the slice '" + (scratch_ / "out/slice_00012.png").string() +
                                       "' of layer 12 is missing; make the stack again with "
                                       "slice-export"));
}

TEST_F(SliceImport, RefusesSlicesOfOtherSizesAndUnknownColours) {
  exported(job(), {scratch_ / "out", "--keep-blank"});
  const auto whole = [&] {
    Import import(scratch_ / "out", true);
    const Schema schema = import.source().plan();
    static_cast<void>(import.source().run(schema.lattice.layers()));
  };
  const std::vector<std::uint32_t> palette = {rgba(0, 0, 0), rgba(9, 8, 7)};
  const auto replace = [&](const SpanImage& image) {
    writeFile(scratch_ / "out/slice_00003.png", encodePng(image, {PngPixels::rgba8, palette, 0, 0}),
              "");
  };
  replace(test::spanImage(181, 154, [](int, int) { return 0U; }));
  EXPECT_THAT(whole, ThrowsMessage<DataError>(HasSubstr(
                         "out/slice_00003.png' of layer 3 has 181 x 154 pixels, not 182 x 154 as "
                         "the stack; make the stack again with slice-export")));
  replace(test::spanImage(182, 154, [](int x, int y) { return x == 17 && y == 4 ? 1U : 0U; }));
  EXPECT_THAT(whole,
              ThrowsMessage<DataError>(HasSubstr(
                  "out/slice_00003.png' of layer 3 has the colour 9,8,7,255 in column 17 of row 4, "
                  "which no material of the manifest has; give it one of theirs, and mind that "
                  "smoothing makes new colours")));
  std::ofstream(scratch_ / "out/slice_00003.png") << "no image";
  EXPECT_THAT(whole, ThrowsMessage<DataError>(HasSubstr("layer 3 is not a readable PNG: ")));
}

TEST_F(SliceImport, RefusesMaterialsOfOneColourAndVoxelsOfTwoMaterials) {
  exported(job(), {scratch_ / "twins"});
  const std::string manifest = scratch_ / "twins/manifest.json";
  nlohmann::ordered_json json = nlohmann::ordered_json::parse(std::ifstream(manifest));
  json["materials"][1]["rgba"] = json["materials"][0]["rgba"];
  std::ofstream(manifest) << json;
  EXPECT_THAT([&] { Import(scratch_ / "twins", true).source().plan(); },
              ThrowsMessage<DataError>(
                  HasSubstr("the material 'black' has the colour of 'white'; make the stack "
                            "with slice-export --format exr, ")));
  exported(job(), {scratch_ / "bits", "--format", "png1"});
  fs::copy_file(scratch_ / "bits/red/slice_00020.png", scratch_ / "bits/black/slice_00020.png",
                fs::copy_options::overwrite_existing);
  EXPECT_THAT(
      [&] {
        Import import(scratch_ / "bits", true);
        const Schema schema = import.source().plan();
        static_cast<void>(import.source().run(schema.lattice.layers()));
      },
      ThrowsMessage<DataError>(HasSubstr("that another material has already")));
}

}  // namespace
}  // namespace vdbdither
