#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/parsed_meshes.h"
#include "tests/support/shapes.h"

namespace vdbdither::test {
namespace {

using openvdb::Vec3d;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::SizeIs;

const std::string corners = "0 0 0\n1 0 0\n0 1 0\n";

void expectTriangle(const Mesh& mesh) {
  expectSame(mesh, {{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 2}}});
}

TEST(Off, UnderstandsEveryFormOfItsHeader) {
  for (const char* header :
       {"OFF\n3 1 0\n", "OFF\r\n3 1 3\r\n", "OFF\r3 1\r", "OFF 3 1 0\n", "OFF3 1 0\n", "off\n3 1\n",
        "OFF\n3\n1\n",
        "\xEF\xBB\xBF\n OFF # by hand\n\n# counts\n 3\t1 0 # edges are not counted\n"}) {
    SCOPED_TRACE(header);
    expectTriangle(parseQuietly(header + corners + "3 0 1 2"));
  }
  expectTriangle(parse("# by hand\n3 1 0\n" + corners + "3 0 1 2\n", nullptr, "part.off"));
}

TEST(Off, ReadsPastNormalsColoursAndTextureCoordinates) {
  for (const char* keyword : {"COFF", "NOFF", "CNOFF", "NCOFF", "STOFF", "STCNOFF"}) {
    SCOPED_TRACE(keyword);
    const std::string vertices =
        "0 0 0 255 0 0 255\n1 0 0 0.5 0.5 0.5 1\n\n# the last\n0 1 0 0 0 1 # up\n";
    expectTriangle(parseQuietly("# by hand\n \n" + std::string(keyword) + "\n3 1 0\n" + vertices +
                                "3 0 1 2  0.1 0.2 0.3\n"));
  }
}

TEST(Off, CutsPolygonsIntoTriangles) {
  const Mesh cube = parseQuietly(
      "OFF\n8 6 12\n-1 -1 1\n1 -1 1\n-1 1 1\n1 1 1\n-1 1 -1\n1 1 -1\n-1 -1 -1\n1 -1 -1\n"
      "4 0 1 3 2\n4 2 3 5 4\n4 4 5 7 6\n4 6 7 1 0\n4 1 7 5 3\n4 6 0 2 4\n");
  EXPECT_THAT(cube.vertices, SizeIs(8));
  EXPECT_THAT(cube.triangles, SizeIs(12));
  EXPECT_EQ(cube.triangles[1], (Mesh::Triangle{0, 3, 2}));
}

const std::string tetrahedron = "0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n";

TEST(Off, ReadsByWordsWhereLinesAreNoElements) {
  const Mesh mesh = parseQuietly("OFF\n4 4 6\n" + tetrahedron);
  for (const char* text :
       {"OFF 4 4 6 0 0 0 1 0 0 0 1 0 0 0 1 3 0 2 1 3 0 1 3 3 0 3 2 3 1 2 3",
        "OFF\n4 4 6\n0 0 0 1 0 0\n0 1 0 0 0 1\n3 0 2 1\n3 0 1 3 # side\n3 0 3 2\n3 1 2 3\n",
        "OFF\n4 4 6\n0\n0\n0\n1 0 0\n0 1 0\n0 0 1\n3 0 2 1 255 0 0\n3 0 1 3\n3 0 3 2\n3 1 2 3\n",
        "NOFF\n4 4 6\n0 0 0 0 0 1 1 0 0 0 0 1 0 1 0 0 0 1 0 0 1\n0 0 1\n3 0 2 1\n3 0 1 3\n3 0 3 "
        "2 3 1 2 3\n"}) {
    SCOPED_TRACE(text);
    expectSame(parseQuietly(text), mesh);
  }
}

TEST(Off, WarnsOfWhatItPassesOver) {
  Warnings warnings;
  parse("OFF\n4 6 0\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n2 0 1\n0\n" + tetrahedron.substr(24) + "more\n",
        &warnings);
  EXPECT_THAT(warnings, ElementsAre("'part': ignored 5 bytes after the last face",
                                    "'part': ignored 2 faces with fewer than 3 corners"));
  EXPECT_EQ(refusal("OFF\n3 1 0\n" + corners + "3 0 1 2\n3 0 1 2\n"),
            "'part', byte 36: 8 bytes follow the last face and the triangles before do not close: "
            "the file is not as its header says; export it again");
}

TEST(Off, RefusesABadHeader) {
  const std::string remedy = "; export or download it again";
  EXPECT_EQ(refusal("OFF\n"),
            "'part', line 2: the header is missing: the file is cut off here" + remedy);
  for (const char* counts : {"BINARY\n", "3\n", "3 -1 0\n", "3 1.5 0\n"}) {
    EXPECT_EQ(refusal(std::string("OFF ") + counts),
              "'part', line 1: the header must count vertices and faces; binary OFF is not read" +
                  remedy);
  }
  EXPECT_EQ(refusal("OFF\n4294967295 1 0\n"),
            "'part', line 2: the header counts more than 4294967294 vertices" + remedy);
  for (const char* keyword : {"4OFF", "nOFF\n4", "ST4nOFF"}) {
    EXPECT_EQ(refusal(std::string(keyword) + "\n3 1 0\n" + corners + "3 0 1 2\n"),
              "'part', line 1: the header announces vertices that do not have three coordinates" +
                  remedy);
  }
  EXPECT_THAT(refusal("OFFSET\n3 1 0\n" + corners + "3 0 1 2\n"), HasSubstr("not a mesh"));
}

TEST(Off, RefusesABadBody) {
  const std::string remedy = "; export or download it again";
  const auto body = [](const std::string& lines) { return refusal("OFF\n3 2 0\n" + lines); };
  EXPECT_EQ(body("0 0 0\n1 0\n"), "'part', line 4: vertex 2 must have three coordinates" + remedy);
  EXPECT_EQ(body("0 0 0\n1 0 x\n"),
            "'part', line 4: vertex 2 must have three coordinates" + remedy);
  EXPECT_EQ(body("0 0 inf\n"), "'part', line 3: vertex 1 is not finite (0 0 inf)" + remedy);
  EXPECT_EQ(body("0 0 0\n"),
            "'part', line 4: vertex 2 is missing: the file is cut off here" + remedy);
  EXPECT_EQ(body(corners + "x\n"), "'part', line 6: face 1 must count its corners" + remedy);
  EXPECT_EQ(body(corners + "3 0 1\n2\n"),
            "'part', line 6: face 1 has fewer corners than it counts" + remedy);
  EXPECT_EQ(body(corners + "3 0 1 -2\n"),
            "'part', line 6: face 1 has fewer corners than it counts" + remedy);
  EXPECT_EQ(
      body(corners + "3 0 1 3\n"),
      "'part', line 6: face 1 has corner 3, but there are 3 vertices, counted from 0" + remedy);
  EXPECT_EQ(body(corners + "3 0 1 2\n"),
            "'part', line 7: face 2 is missing: the file is cut off here" + remedy);
}

TEST(Off, CountsOfBillionsAreRefusedAtOnce) {
  EXPECT_THAT(refusal("OFF\n4294967294 1 0\n0 0 0\n"), HasSubstr("vertex 2 is missing"));
  EXPECT_THAT(refusal("OFF\n3 18446744073709551615 0\n" + corners + "3 0 1 2\n"),
              HasSubstr("face 2 is missing"));
  EXPECT_THAT(refusal("OFF\n3 1 0\n" + corners + "18446744073709551615 0 1 2\n"),
              HasSubstr("face 1 has fewer corners than it counts"));
}

TEST(Off, NeverPassesOffAHalfAsTheWhole) {
  expectEveryPrefixIsReadOrRefused("OFF\n3 2 0\n" + corners + "3 0 1 2\n3 2 1 0\n", true);
}

}  // namespace
}  // namespace vdbdither::test
