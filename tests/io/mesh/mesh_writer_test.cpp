#include "io/mesh/mesh_writer.h"

#include <fstream>
#include <sstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "io/mesh/mesh_reader.h"
#include "tests/support/mesh_files.h"
#include "tests/support/scratch_folder.h"
#include "tests/support/shapes.h"
#include "vdbdither/model/errors.h"

namespace vdbdither {
namespace {

using testing::HasSubstr;
using testing::ThrowsMessage;

Mesh torus() { return test::torusMesh({0, 0, 0}, 0.7, 0.3, 24); }

std::string textOf(const std::filesystem::path& path) {
  std::ostringstream text;
  text << std::ifstream(path, std::ios::binary).rdbuf();
  return text.str();
}

TEST(MeshWriter, TheFileAppearsWhenItIsComplete) {
  const test::ScratchFolder scratch;
  const Mesh mesh = torus();
  for (const MeshFormat* format : test::writtenMeshFormats()) {
    const std::string name = "a" + std::string(format->ending);
    MeshWriter writer(scratch / name);
    writer.add(mesh.vertices, mesh.triangles, 0);
    EXPECT_FALSE(std::filesystem::exists(scratch / name));
    writer.commit();
    EXPECT_TRUE(std::filesystem::exists(scratch / name));
    EXPECT_EQ(writer.vertices(), mesh.vertices.size());
    EXPECT_EQ(writer.triangles(), mesh.triangles.size());
  }
}

TEST(MeshWriter, PlyCarriesColoursAndANumber) {
  const test::ScratchFolder scratch;
  const Mesh box = test::boxMesh({0, 0, 0}, {1, 1, 1});
  std::vector<std::array<std::uint8_t, 3>> colours(8, {1, 2, 3});
  const std::vector<float> qualities(8, 0.5F);
  MeshWriter writer(scratch / "a.ply", MeshEncoding{{true, true, "as it was measured"}, {}});
  writer.add(box.vertices, box.triangles, 0, colours, qualities);
  writer.commit();
  const std::string text = textOf(scratch / "a.ply");
  EXPECT_THAT(text, HasSubstr("comment as it was measured\nelement vertex 8\nproperty float x\n"));
  EXPECT_THAT(text, HasSubstr("property uchar red\nproperty uchar green\nproperty uchar blue\n"
                              "property float quality\nelement face 12\n"));
  const std::size_t body = text.find("end_header\n") + 11;
  EXPECT_EQ(text.size() - body, 8U * (12 + 3 + 4) + 12U * 13);
  EXPECT_EQ(text.substr(body + 12, 3), "\x01\x02\x03");
  EXPECT_EQ(readMesh(scratch / "a.ply", {}).triangles, box.triangles);
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
              ThrowsMessage<UsageError>("'part.gltf' is no mesh file that is written; name a " +
                                        meshEndings() + " file"));
  std::ofstream(scratch / "a.stl") << "old";
  EXPECT_THAT([&] { MeshWriter::check(scratch / "a.stl", false); },
              ThrowsMessage<UsageError>(HasSubstr("exists; --overwrite replaces it")));
  MeshWriter::check(scratch / "a.stl", true);
}

}  // namespace
}  // namespace vdbdither
