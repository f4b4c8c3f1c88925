#include "io/mesh/mesh_format.h"

#include <algorithm>
#include <cctype>
#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "io/mesh/mesh_writer.h"
#include "tests/support/mesh_files.h"
#include "tests/support/parsed_meshes.h"
#include "tests/support/scratch_folder.h"
#include "tests/support/shapes.h"

namespace vdbdither::test {
namespace {

std::vector<openvdb::Vec3s> floatsOf(const Mesh& mesh) {
  return {mesh.vertices.begin(), mesh.vertices.end()};
}

/// What every format that is written promises.
class MeshFormats : public testing::TestWithParam<const MeshFormat*> {
 protected:
  [[nodiscard]] static std::string fileName() { return "part" + std::string(GetParam()->ending); }

  /// The bytes of a file of the format.
  [[nodiscard]] std::string written(const Mesh& mesh) const {
    MeshWriter writer(scratch_ / fileName());
    writer.add(mesh.vertices, mesh.triangles, 0);
    writer.commit();
    const std::vector<std::uint8_t> bytes = filesUnder(scratch_.path()).at(fileName());
    return {bytes.begin(), bytes.end()};
  }

  ScratchFolder scratch_;
};

TEST_P(MeshFormats, ReadsBackWhatItWrites) {
  const Mesh mesh = floatPart();
  const Mesh read = parseQuietly(written(mesh));
  // A text holds the shortest decimal that reads as the same float.
  EXPECT_EQ(floatsOf(read), floatsOf(mesh));
  EXPECT_EQ(read.triangles, mesh.triangles);
  EXPECT_EQ(filesUnder(scratch_.path()).size(), 1U) << "nothing else is left";
}

TEST_P(MeshFormats, PiecesMakeTheSameFileAsTheWhole) {
  const Mesh mesh = floatPart();
  MeshWriter writer(scratch_ / ("pieces" + fileName()));
  // Every triangle in a piece of its own, behind the vertices that it needs.
  std::uint32_t given = 0;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const Mesh::Triangle& triangle = mesh.triangles[t];
    const std::uint32_t needed = *std::max_element(triangle.begin(), triangle.end()) + 1;
    std::uint32_t open_from = needed;
    for (std::size_t later = t + 1; later < mesh.triangles.size(); ++later) {
      for (const std::uint32_t vertex : mesh.triangles[later])
        open_from = std::min(open_from, vertex);
    }
    const std::uint32_t upto = std::max(given, needed);
    writer.add(std::span(mesh.vertices).subspan(given, upto - given), {&triangle, 1}, open_from);
    given = upto;
  }
  writer.commit();
  const std::string whole = written(mesh);
  const auto files = filesUnder(scratch_.path());
  EXPECT_TRUE(files.at("pieces" + fileName()) == files.at(fileName()));
}

TEST_P(MeshFormats, EveryPrefixOfAFileIsReadOrRefused) {
  expectEveryPrefixIsReadOrRefused(written(boxMesh({0, 0, 0}, {1, 2, 3})), false);
}

TEST_P(MeshFormats, ASpoiltFileIsReadOrRefused) {
  expectSpoiltBytesAreReadOrRefused(written(boxMesh({0, 0, 0}, {1, 2, 3})));
}

TEST_P(MeshFormats, ItsFilesAreOfNoOtherFormat) {
  const std::string bytes = written(floatPart());
  for (const MeshFormat* format : meshFormats()) {
    const MeshMatch match = format->match(MeshFile("part", bytes, {}));
    EXPECT_EQ(match == MeshMatch::none, format != GetParam()) << format->name;
  }
}

TEST_P(MeshFormats, EstimatesTheSizeOfItsFiles) {
  const Mesh mesh = sphereMesh({0, 0, 0}, 10, 60);
  const double estimate = GetParam()->bytes_per_vertex * static_cast<double>(mesh.vertices.size());
  EXPECT_NEAR(static_cast<double>(written(mesh).size()) / estimate, 1, 0.2);
}

TEST_P(MeshFormats, IsNamedByItsEndingInAnyCase) {
  std::string ending(GetParam()->ending);
  EXPECT_EQ(meshFormatNamedBy("a.b" + ending), GetParam());
  for (char& c : ending) c = static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
  EXPECT_EQ(meshFormatNamedBy("part" + ending), GetParam());
}

INSTANTIATE_TEST_SUITE_P(Registered, MeshFormats, testing::ValuesIn(writtenMeshFormats()),
                         [](const auto& format) { return std::string(format.param->name); });

TEST(MeshFormatTable, IsListedInMessages) {
  EXPECT_THAT(meshFormatNames(), testing::ContainsRegex("OBJ, .*PLY.* or "));
  EXPECT_THAT(meshEndings(), testing::ContainsRegex("\\.obj, .*\\.ply.* or \\."));
  const std::string coloured =
      meshEndings([](const MeshFormat& format) { return format.holds_extras; });
  EXPECT_THAT(coloured, testing::HasSubstr(".ply"));
  EXPECT_THAT(coloured, testing::Not(testing::HasSubstr(".stl")));
  EXPECT_EQ(meshFormatNamedBy("part"), nullptr);
  EXPECT_EQ(meshFormatNamedBy("part.stl.gz"), nullptr);
}

}  // namespace
}  // namespace vdbdither::test
