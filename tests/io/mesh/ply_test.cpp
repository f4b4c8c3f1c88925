#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/mesh_files.h"
#include "tests/support/parsed_meshes.h"
#include "tests/support/shapes.h"

namespace vdbdither::test {
namespace {

using openvdb::Vec3d;
using testing::ElementsAre;
using testing::HasSubstr;

TEST(Ply, ReadsAnyScalarAndSkipsWhatItDoesNotNeed) {
  const std::string text =
      "ply\r\nformat ascii 1.0\r\ncomment x\r\nobj_info y\r\nelement camera 1\r\n"
      "property list uchar float names\r\nproperty double angle\r\nelement nothing 3\r\n"
      "element vertex 4\r\n"
      "property uchar red\r\nproperty int16 z\r\nproperty list int8 int8 tags\r\nproperty double "
      "x\r\n"
      "property uint8 y\r\nelement face 2\r\nproperty list uint16 double vertex_index\r\n"
      "property float quality\r\nelement edge 1\r\nproperty int vertex1\r\nend_header\r\n"
      "2 1.5 2.5 0.1\r\n255 0 0 0 0\r\n255 0 2 1 2 1 0\r\n0 0 0 1 1\r\n0 -7 1 9 0.25 1\r\n"
      "4 0 1 2 3 0.5\r\n3 0 2 1 0.5\r\n12\r\n";
  const Mesh mesh = parseQuietly(text);
  EXPECT_THAT(mesh.vertices,
              ElementsAre(Vec3d(0, 0, 0), Vec3d(1, 0, 0), Vec3d(1, 1, 0), Vec3d(0.25, 1, -7)));
  EXPECT_THAT(mesh.triangles, ElementsAre(Mesh::Triangle{0, 1, 2}, Mesh::Triangle{0, 2, 3},
                                          Mesh::Triangle{0, 2, 1}));
}

TEST(Ply, TellsTheEndOfTheHeaderFromABodyThatStartsWithALineFeed) {
  Mesh mesh = boxMesh({0, 0, 0}, {1, 1, 1});
  mesh.vertices[0].x() = 6.4061e-10;  // as a float: 0A 1A 30 30
  mesh.vertices[0] = Vec3d(openvdb::Vec3s(mesh.vertices[0]));
  std::string bytes = plyFile(mesh, PlyEncoding::kLittleEndian);
  const std::size_t body = bytes.find("end_header\n") + 11;
  bytes[body] = '\n';
  const Mesh read = parseQuietly(bytes);
  EXPECT_NEAR(read.vertices[0].x(), mesh.vertices[0].x(), 1e-12);
  EXPECT_EQ(read.vertices[1], mesh.vertices[1]);
  std::string with_returns;
  for (std::size_t i = 0; i < body; ++i) {
    if (bytes[i] == '\n') with_returns += '\r';
    with_returns += bytes[i];
  }
  with_returns.append(bytes, body);
  expectSame(parseQuietly(with_returns), read);
}

TEST(Ply, TurnsEverySecondTriangleOfAStrip) {
  const Mesh mesh = parseQuietly(
      "ply\nformat ascii 1.0\nelement vertex 5\nproperty float x\nproperty float y\n"
      "property float z\nelement tristrips 1\nproperty list int int vertex_indices\nend_header\n"
      "0 0 0\n1 0 0\n0 1 0\n1 1 0\n0 2 0\n11 0 1 2 3 -1 1 2 2 3 4 -1\n");
  EXPECT_THAT(mesh.triangles, ElementsAre(Mesh::Triangle{0, 1, 2}, Mesh::Triangle{2, 1, 3},
                                          Mesh::Triangle{2, 3, 4}));
}

TEST(Ply, WarnsOfBytesAfterTheEnd) {
  const std::string bytes = plyFile(floatPart(), PlyEncoding::kBigEndian) + "more";
  Warnings warnings;
  parse(bytes, &warnings);
  EXPECT_THAT(warnings, ElementsAre("'part': ignored 4 bytes after the last element"));
}

TEST(Ply, RefusesABadHeader) {
  const std::string start = "ply\nformat ascii 1.0\n";
  const auto refused = [&](const std::string& lines) { return refusal(start + lines); };
  EXPECT_EQ(refused("element vertex 1\n"),
            "'part', line 4: cut off: the header has no 'end_header'; export it again");
  EXPECT_EQ(refusal("ply\nformat ascii\n"),
            "'part', line 2: the format is not 'ascii 1.0', 'binary_little_endian 1.0' or "
            "'binary_big_endian 1.0'; export it again");
  EXPECT_EQ(refusal("ply\nend_header\n"),
            "'part', line 2: the header has no 'format'; export it again");
  EXPECT_EQ(refused("element vertex -1\n"),
            "'part', line 3: element 'vertex' has no count; export it again");
  EXPECT_EQ(refused("element vertex 1\nelement vertex 2\n"),
            "'part', line 4: element 'vertex' is declared twice; export it again");
  EXPECT_EQ(refused("property int x\n"),
            "'part', line 3: a property before any element; export it again");
  EXPECT_EQ(refused("element vertex 1\nproperty long x\n"),
            "'part', line 4: 'long' is no scalar type of PLY; export it again");
  EXPECT_EQ(refused("element vertex 1\nproperty int\n"),
            "'part', line 4: a property has no name; export it again");
  EXPECT_EQ(refused("elements vertex 1\n"),
            "'part', line 3: 'elements' is no keyword of a PLY header; export it again");
  EXPECT_EQ(refused("element vertex 1\nproperty int x\nproperty list int int y\nend_header\n"),
            "'part': the vertices have no scalar property 'y'; export it again");
  EXPECT_EQ(refused("element face 1\nproperty list int int corners\nend_header\n"),
            "'part': element 'face' has no list 'vertex_indices'; export it again");
  EXPECT_EQ(refused("element vertex 99999999999\nproperty int x\nproperty int y\nproperty int z\n"
                    "end_header\n"),
            "'part': more than 4294967294 vertices; split the part");
}

TEST(Ply, RefusesABadBody) {
  const std::string header =
      "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
      "property float z\nelement face 1\nproperty list char float vertex_indices\nend_header\n";
  const auto refused = [&](const std::string& lines) { return refusal(header + lines); };
  const std::string vertices = "0 0 0\n1 0 0\n0 1 0\n";
  EXPECT_EQ(refused("0 0 0\n1 x 0\n"),
            "'part', line 11: vertex 2 of 3: 'x' is not a number; export it again");
  EXPECT_EQ(refused("0 0 0\n1 nan 0\n"),
            "'part', line 11: vertex 2 of 3: the vertex is not finite (1 nan 0); repair the mesh");
  EXPECT_EQ(refused("0 0 0\n1 0"),
            "'part', line 11: vertex 2 of 3: cut off here; export or download it again");
  for (const char* face : {"3 0 1 3", "3 0 1 -1", "3 0 1 0.5", "3 0 1 nan"}) {
    EXPECT_EQ(refused(vertices + face),
              "'part', line 13: face 1 of 1: a vertex index is out of range: 3 vertices before the "
              "faces, counted from 0; export it again");
  }
  EXPECT_EQ(
      refused(vertices + "-3 0 1 2"),
      "'part', line 13: face 1 of 1: the list 'vertex_indices' has a length that is no count");
  EXPECT_EQ(refused(vertices + "100 0 1 2"),
            "'part', line 13: face 1 of 1: cut off here; export or download it again");
  const std::string binary = plyFile(boxMesh({0, 0, 0}, {1, 1, 1}), PlyEncoding::kLittleEndian);
  EXPECT_EQ(refusal(binary.substr(0, binary.size() - 1)),
            "'part', byte " + std::to_string(binary.size() - 12) +
                ": face 12 of 12: cut off here; export or download it again");
}

TEST(Ply, AHeaderThatAnnouncesBillionsIsRefusedAtOnce) {
  for (const char* format : {"ascii", "binary_little_endian"}) {
    EXPECT_THAT(
        refusal("ply\nformat " + std::string(format) +
                " 1.0\nelement nothing 18446744073709551615\nelement vertex 4294967294\n"
                "property float x\nproperty float y\nproperty float z\nend_header\n0 0 0\n"),
        HasSubstr("of 4294967294: cut off here; export or download it again"));
  }
}

}  // namespace
}  // namespace vdbdither::test
