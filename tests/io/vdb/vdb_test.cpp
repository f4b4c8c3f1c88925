#include "io/vdb/vdb.h"

#include <filesystem>
#include <fstream>
#include <random>

#include <gtest/gtest.h>

#include "tests/support/scratch_folder.h"
#include "vdbdither/model/errors.h"
#include "vdbdither/model/openvdb.h"

namespace vdbdither {
namespace {

using test::ScratchFolder;

VdbContents sample() {
  const auto surface = openvdb::FloatGrid::create(0.2F);
  surface->setTransform(openvdb::math::Transform::createLinearTransform(openvdb::math::Mat4d(
      0.042, 0., 0., 0., 0., 0.084, 0., 0., 0., 0., 0.022, 0., 0., -0.021, 0., 1.)));
  surface->setGridClass(openvdb::GRID_LEVEL_SET);
  std::mt19937 random(3);
  std::uniform_int_distribution<int> at(-30, 30);
  for (int i = 0; i < 500; ++i)
    surface->tree().setValue({at(random), at(random), at(random)},
                             0.01F * static_cast<float>(at(random)));
  const auto solid = openvdb::BoolGrid::create(false);
  solid->setTransform(surface->transformPtr());
  solid->sparseFill(openvdb::CoordBBox({-8, -8, -8}, {7, 7, 7}), true);
  VdbContents contents;
  contents.grids = {{"surface", surface}, {"solid", solid}};
  contents.metadata = {{"vdbdither:history", "mesh2sdf a.stl\ndither"},
                       {"vdbdither:box", "-30 -30 -30 30 30 30"}};
  return contents;
}

std::string bytesOf(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

void writeBytes(const std::filesystem::path& path, const std::string& bytes) {
  std::ofstream(path, std::ios::binary)
      .write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
}

template <typename Function>
std::string refusal(const Function& function) {
  try {
    function();
  } catch (const DataError& error) {
    return error.what();
  }
  return "";
}

class Vdb : public testing::Test {
 protected:
  void SetUp() override { initializeVdb(); }

  ScratchFolder folder_;
};

TEST_F(Vdb, WhatWasWrittenReadsBack) {
  for (const VdbCodec codec : {VdbCodec::none, VdbCodec::mask, VdbCodec::blosc}) {
    const VdbContents contents = sample();
    const auto path = folder_.path() / "a.vdb";
    writeVdb(path, contents, codec, path);
    const VdbContents again = readVdb(path);
    EXPECT_EQ(again.metadata, contents.metadata);
    EXPECT_EQ(archiveBytes(again, VdbCodec::none), archiveBytes(contents, VdbCodec::none));
    EXPECT_EQ(readGrid(path, "solid")->activeVoxelCount(), 4096U);
  }
}

TEST_F(Vdb, TheSameContentsAreTheSameBytes) {
  writeVdb(folder_.path() / "a.vdb", sample(), VdbCodec::blosc, "a.vdb");
  writeVdb(folder_.path() / "b.vdb", sample(), VdbCodec::blosc, "b.vdb");
  EXPECT_EQ(bytesOf(folder_.path() / "a.vdb"), bytesOf(folder_.path() / "b.vdb"));
}

TEST_F(Vdb, AFlippedByteAnywhereIsFound) {
  const auto path = folder_.path() / "a.vdb";
  writeVdb(path, sample(), VdbCodec::blosc, path);
  const std::string bytes = bytesOf(path);
  std::mt19937 random(11);
  for (int i = 0; i < 300; ++i) {
    std::string damaged = bytes;
    // Byte 14 of the UUID says that it is a digest; without it the file passes for another tool's.
    const std::size_t at = std::uniform_int_distribution<std::size_t>(60, bytes.size() - 1)(random);
    damaged[at] = static_cast<char>(damaged[at] ^ (1 << (i % 8)));
    writeBytes(path, damaged);
    EXPECT_NE(refusal([&] { readVdb(path); }), "") << "byte " << at;
  }
}

TEST_F(Vdb, EveryTruncationIsFound) {
  const auto path = folder_.path() / "a.vdb";
  writeVdb(path, sample(), VdbCodec::blosc, path);
  const std::string bytes = bytesOf(path);
  for (std::size_t size = 0; size < bytes.size(); size += 1 + size / 16) {
    writeBytes(path, bytes.substr(0, size));
    EXPECT_NE(refusal([&] { readVdb(path); }), "") << size;
  }
}

TEST_F(Vdb, RefusalsNameTheFile) {
  EXPECT_EQ(refusal([&] { readVdb("none.vdb"); }), "no such file 'none.vdb'");
  EXPECT_EQ(refusal([&] { readVdb(folder_.path()); }),
            "'" + folder_.path().string() + "' is not a file");
  const auto path = folder_.path() / "text.vdb";
  writeBytes(path, "solid part\nendsolid\n");
  EXPECT_NE(refusal([&] { readVdb(path); }).find("text.vdb' is not a readable VDB archive"),
            std::string::npos);
  writeVdb(path, sample(), VdbCodec::none, path);
  EXPECT_EQ(refusal([&] { readGrid(path, "mask"); }),
            "'" + path.string() + "' has no grid 'mask'; it has solid surface");
}

TEST_F(Vdb, AFullDiskIsNamed) {
  EXPECT_EQ(refusal([&] { writeVdb("/dev/full", sample(), VdbCodec::none, "part.vdb"); }),
            "cannot write 'part.vdb': No space left on device");
}

TEST_F(Vdb, TheSchemaIsTheLatticeOfTheFile) {
  const Schema schema = schemaOf(sample(), "it");
  EXPECT_EQ(schema.lattice.pitch_mm, openvdb::Vec3d(0.042, 0.084, 0.022));
  EXPECT_EQ(schema.lattice.origin_mm, openvdb::Vec3d(0, -0.021, 0));
  EXPECT_EQ(schema.lattice.box, openvdb::CoordBBox({-30, -30, -30}, {30, 30, 30}));
  EXPECT_TRUE(schema.grids.at("solid")->empty());
  EXPECT_EQ(schema.metadata.at("vdbdither:history"), "mesh2sdf a.stl\ndither");
  const VdbContents back = contentsOf(schema, sample().grids);
  EXPECT_EQ(back.metadata.at("vdbdither:box"), "-30 -30 -30 30 30 30");
}

TEST_F(Vdb, AFileOfAnotherToolHasTheBoxOfItsVoxels) {
  VdbContents contents = sample();
  contents.metadata.clear();
  EXPECT_EQ(schemaOf(contents, "it").lattice.box,
            contents.grids.at("surface")->evalActiveVoxelBoundingBox());
  openvdb::io::File(folder_.path() / "other.vdb")
      .write(openvdb::GridCPtrVec{contents.grids.at("solid")});
  EXPECT_EQ(schemaOf(readVdb(folder_.path() / "other.vdb"), "it").lattice.box,
            openvdb::CoordBBox({-8, -8, -8}, {7, 7, 7}));
}

TEST_F(Vdb, AFileIsNoFrameOfAPipe) {
  VdbContents contents = sample();
  contents.metadata["vdbdither:frame"] = "head";
  contents.metadata["vdbdither:run"] = "x";
  EXPECT_EQ(schemaOf(contents, "it").metadata.size(), 1U);
}

TEST_F(Vdb, TurnedAndUnlikeGridsAreRefused) {
  VdbContents contents = sample();
  const auto turned = openvdb::FloatGrid::create(1);
  turned->transform().postRotate(0.3);
  turned->setName("t");
  EXPECT_EQ(
      refusal([&] {
        schemaOf({{{"t", turned}}, {}}, "it");
      }),
      "it: grid 't' is turned, mirrored or sheared; resample --grid t brings it onto the printer's "
      "lattice");
  const auto cubes = openvdb::FloatGrid::create(1);
  contents.grids["cubes"] = cubes;
  EXPECT_NE(refusal([&] { schemaOf(contents, "it"); }).find("lie on different lattices"),
            std::string::npos);
  EXPECT_EQ(refusal([&] { schemaOf({}, "it"); }), "it holds no grid");
}

TEST_F(Vdb, AGridOfPicoGkIsLeftToResample) {
  const auto grid = openvdb::FloatGrid::create(3);
  grid->setName("ball");
  EXPECT_TRUE(latticeOf(*grid));
  grid->insertMeta("PicoGK.VoxelSize", openvdb::FloatMetadata(0.0002F));
  EXPECT_EQ(picoGkVoxelMm(*grid), 0.2);
  EXPECT_FALSE(latticeOf(*grid));
  EXPECT_EQ(
      refusal([&] {
        schemaOf({{{"ball", grid}}, {}}, "it");
      }),
      "it: grid 'ball' comes from PicoGK, with an identity as its transform and voxels of 0.2 mm "
      "in its metadata, which resample --grid ball honours");
  grid->insertMeta("PicoGK.VoxelSize", openvdb::FloatMetadata(0));
  EXPECT_FALSE(picoGkVoxelMm(*grid));
  grid->insertMeta("PicoGK.VoxelSize", openvdb::FloatMetadata(0.0002F));
  grid->setTransform(openvdb::math::Transform::createLinearTransform(0.2));
  EXPECT_FALSE(picoGkVoxelMm(*grid));
}

TEST_F(Vdb, BoxesThatCannotBeCountedAreRefused) {
  VdbContents contents = sample();
  for (const char* box : {"0 0 0 1 1", "a", "0 0 0 1 1 2147483647", "-2000000000 0 0 1 1 1"}) {
    contents.metadata["vdbdither:box"] = box;
    EXPECT_NE(
        refusal([&] { schemaOf(contents, "it"); }).find("is not six whole numbers from -2^30"),
        std::string::npos)
        << box;
  }
  contents.metadata["vdbdither:box"] = "0 0 -500000000 1 1 500000000";
  EXPECT_EQ(refusal([&] { schemaOf(contents, "it"); }),
            "it has 1000000001 layers, and at most 10000000 are processed; check its box and its "
            "grids");
  const auto far = openvdb::FloatGrid::create(1);
  far->tree().setValue({0, 0, 2147483000}, 0);
  EXPECT_NE(refusal([&] {
              schemaOf({{{"far", far}}, {}}, "it");
            }).find("voxels beyond index 2^30"),
            std::string::npos);
}

}  // namespace
}  // namespace vdbdither
