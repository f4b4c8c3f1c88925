#include "io/mesh/mesh_writer.h"

#include <fstream>
#include <sstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "io/mesh/mesh_reader.h"
#include "tests/support/scratch_folder.h"
#include "tests/support/shapes.h"
#include "vdbdither/model/errors.h"

namespace vdbdither {
namespace {

using openvdb::Vec3d;
using testing::HasSubstr;
using testing::ThrowsMessage;

/// A torus in float precision, so that it reads back as it is.
Mesh torus() {
  Mesh mesh = test::torusMesh({0, 0, 0}, 0.7, 0.3, 24);
  for (Vec3d& p : mesh.vertices) p = Vec3d(openvdb::Vec3s(p));
  return mesh;
}

Mesh readBack(const std::filesystem::path& path) {
  return readMesh(path, [](const std::string& warning) { ADD_FAILURE() << warning; });
}

std::string textOf(const std::filesystem::path& path) {
  std::ostringstream text;
  text << std::ifstream(path, std::ios::binary).rdbuf();
  return text.str();
}

TEST(MeshWriter, WhatItWritesReadsBackTheSameInEveryFormat) {
  const test::ScratchFolder scratch;
  const Mesh mesh = torus();
  for (const char* name : {"a.stl", "a.obj", "a.ply", "a.PLY"}) {
    MeshWriter writer(scratch / name);
    EXPECT_FALSE(std::filesystem::exists(scratch / name)) << "not before it is complete";
    writer.add(mesh.vertices, mesh.triangles, 0);
    writer.commit();
    const Mesh read = readBack(scratch / name);
    ASSERT_EQ(read.triangles.size(), mesh.triangles.size());
    for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
      for (std::size_t n = 0; n < 3; ++n) {
        EXPECT_EQ(openvdb::Vec3s(read.vertices[read.triangles[t][n]]),
                  openvdb::Vec3s(mesh.vertices[mesh.triangles[t][n]]));
      }
    }
    if (std::string(name) != "a.stl") {
      EXPECT_EQ(read.triangles, mesh.triangles);
    }
  }
  EXPECT_EQ(test::filesUnder(scratch.path()).size(), 4U) << "nothing else is left";
}

TEST(MeshWriter, PiecesMakeTheSameFileAsTheWhole) {
  const test::ScratchFolder scratch;
  const Mesh mesh = torus();
  for (const std::string extension : {".stl", ".obj", ".ply"}) {
    MeshWriter whole(scratch / ("whole" + extension));
    whole.add(mesh.vertices, {}, 0);
    whole.add({}, mesh.triangles, 0);
    whole.commit();
    // Every triangle in a piece of its own, behind the vertices that it needs.
    MeshWriter pieces(scratch / ("pieces" + extension));
    std::uint32_t given = 0;
    for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
      const Mesh::Triangle& triangle = mesh.triangles[t];
      const std::uint32_t needed = std::max({triangle[0], triangle[1], triangle[2]}) + 1;
      std::uint32_t open_from = needed;
      for (std::size_t later = t + 1; later < mesh.triangles.size(); ++later) {
        for (const std::uint32_t vertex : mesh.triangles[later])
          open_from = std::min(open_from, vertex);
      }
      const std::uint32_t upto = std::max(given, needed);
      pieces.add(std::span(mesh.vertices).subspan(given, upto - given), {&triangle, 1}, open_from);
      given = upto;
    }
    pieces.commit();
    EXPECT_EQ(textOf(scratch / ("pieces" + extension)), textOf(scratch / ("whole" + extension)));
  }
}

TEST(MeshWriter, PlyCarriesColoursAndANumber) {
  const test::ScratchFolder scratch;
  const Mesh box = test::boxMesh({0, 0, 0}, {1, 1, 1});
  std::vector<std::array<std::uint8_t, 3>> colours(8, {1, 2, 3});
  const std::vector<float> qualities(8, 0.5F);
  MeshWriter writer(scratch / "a.ply", {true, true, "as it was measured"});
  writer.add(box.vertices, box.triangles, 0, colours, qualities);
  writer.commit();
  const std::string text = textOf(scratch / "a.ply");
  EXPECT_THAT(text, HasSubstr("comment as it was measured\nelement vertex 8\nproperty float x\n"));
  EXPECT_THAT(text, HasSubstr("property uchar red\nproperty uchar green\nproperty uchar blue\n"
                              "property float quality\nelement face 12\n"));
  const std::size_t body = text.find("end_header\n") + 11;
  EXPECT_EQ(text.size() - body, 8U * (12 + 3 + 4) + 12U * 13);
  EXPECT_EQ(text.substr(body + 12, 3), "\x01\x02\x03");
  EXPECT_EQ(readBack(scratch / "a.ply").triangles, box.triangles);
}

TEST(MeshWriter, LeavesNothingWhenItIsGivenUp) {
  const test::ScratchFolder scratch;
  {
    MeshWriter writer(scratch / "a.ply");
    writer.add(torus().vertices, {}, 0);
  }
  EXPECT_TRUE(test::filesUnder(scratch.path()).empty());
}

TEST(MeshWriter, RefusesOtherFormatsAndWhatIsThere) {
  const test::ScratchFolder scratch;
  EXPECT_THAT([] { MeshWriter::check("part.gltf", false); },
              ThrowsMessage<UsageError>(
                  "'part.gltf' is no mesh file that is written; name a .stl, .obj or .ply file"));
  std::ofstream(scratch / "a.stl") << "old";
  EXPECT_THAT([&] { MeshWriter::check(scratch / "a.stl", false); },
              ThrowsMessage<UsageError>(HasSubstr("exists; --overwrite replaces it")));
  MeshWriter::check(scratch / "a.stl", true);
}

}  // namespace
}  // namespace vdbdither
