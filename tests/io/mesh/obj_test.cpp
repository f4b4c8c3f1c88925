#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/parsed_meshes.h"

namespace vdbdither::test {
namespace {

using openvdb::Vec3d;
using testing::ElementsAre;

TEST(Obj, UnderstandsEveryFormOfACorner) {
  const std::string vertices = "v 0 0 0 1\nv 1 0 0 0.5 0.5 0.5\nv 0 1 0\nvt 0 0\nvn 0 0 1\n";
  for (const char* face :
       {"f 1 2 3", "f 1/1 2/1 3/1", "f 1//1 2//1 3//1", "f 1/1/1 2/1/1 3/1/1", "f -3 -2 -1",
        "f -3/-1/-1 2/1 3", "f 1 \\\n 2\\\n 3", "f\t1\t2\t3\t", "f 1 2 3 # a face", "f 1 2 3#\\",
        "f 1 2 \\  \n3", "f 1/ 2// 3/\r", "fo 1 2 3"}) {
    SCOPED_TRACE(face);
    const Mesh mesh = parseQuietly(vertices + face);
    EXPECT_THAT(mesh.triangles, ElementsAre(Mesh::Triangle{0, 1, 2}));
    EXPECT_THAT(mesh.vertices, ElementsAre(Vec3d(0, 0, 0), Vec3d(1, 0, 0), Vec3d(0, 1, 0)));
  }
}

TEST(Obj, CountsNegativeIndicesFromTheLatestVertex) {
  const Mesh mesh = parseQuietly(
      "o a\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf -3 -2 -1\no b\nv 0 0 5\nv 1 0 5\nv 0 1 5\nf -3 -2 -1\n");
  EXPECT_THAT(mesh.triangles, ElementsAre(Mesh::Triangle{0, 1, 2}, Mesh::Triangle{3, 4, 5}));
}

TEST(Obj, FacesMayComeBeforeTheirVertices) {
  const std::string vertices = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nv 1 1 0\n";
  const Mesh mesh = parseQuietly("f 1 2 5 3\nv 9 9 9\n" + vertices + "f -1 -2 -5\nf 4 1 2\n");
  EXPECT_THAT(mesh.vertices, ElementsAre(Vec3d(9, 9, 9), Vec3d(0, 0, 0), Vec3d(1, 0, 0),
                                         Vec3d(0, 1, 0), Vec3d(0, 0, 1), Vec3d(1, 1, 0)));
  ASSERT_THAT(mesh.triangles, testing::SizeIs(4));
  EXPECT_EQ(mesh.triangles[2], (Mesh::Triangle{5, 4, 1}));
  EXPECT_EQ(refusal("f 1 2 6\n" + vertices),
            "'part', line 1: face corner '6' is out of range: the file has 5 vertices, counted "
            "from 1; export it again");
  EXPECT_EQ(refusal("f -1 -2 -3\n" + vertices),
            "'part', line 1: face corner '-1' is out of range: 0 vertices so far, counted from 1; "
            "export it again");
}

TEST(Obj, ACommentEndsAStatementAnywhere) {
  const Mesh mesh = parseQuietly(
      "v 0 0 0#first\nv 1 0 0 # second \\\nv 0 1 0\t# third\nusemtl a#b\nf 1 2 3# 4\n#f 1 2 2\n");
  EXPECT_THAT(mesh.vertices, ElementsAre(Vec3d(0, 0, 0), Vec3d(1, 0, 0), Vec3d(0, 1, 0)));
  EXPECT_THAT(mesh.triangles, ElementsAre(Mesh::Triangle{0, 1, 2}));
}

TEST(Obj, ABackslashEndsTheNameOfAFolderAndNotTheLine) {
  const Mesh mesh = parseQuietly(
      "# C:\\parts\\\nv 0 0 0\nv 1 0 0\nusemtl a\\\nv 0 \\\n1 0\nvt 0 \\\n 0\nf 1 2 3\n");
  EXPECT_THAT(mesh.vertices, testing::SizeIs(3));
}

TEST(Obj, WarnsOnceOfWhatItPassesOver) {
  Warnings warnings;
  parse("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2\nf 1\ncurv 1 2 3\nsurf 1 2\nf 1 2 3\n", &warnings);
  EXPECT_THAT(
      warnings,
      ElementsAre("'part': ignored 2 faces with fewer than 3 corners",
                  "'part', line 6: ignored 2 statements that are not polygons, from here on"));
}

TEST(Obj, RefusesWhatItCannotTake) {
  const auto body = [](const std::string& line) {
    return refusal("v 0 0 0\nv 1 0 0\nv 0 1 0\n" + line + "\n");
  };
  const auto out_of_range = [](const std::string& corner) {
    return "'part', line 4: face corner '" + corner +
           "' is out of range: 3 vertices so far, counted from 1; export it again";
  };
  EXPECT_EQ(body("f 1 2 4"),
            "'part', line 4: face corner '4' is out of range: the file has 3 vertices, counted "
            "from 1; export it again");
  EXPECT_EQ(body("f 1 2 4294967296"), out_of_range("4294967296"));
  EXPECT_EQ(body("f 1 2 0"), out_of_range("0"));
  EXPECT_EQ(body("f 1 2 -4/1"), out_of_range("-4/1"));
  EXPECT_EQ(body("f 1 2 99999999999999999999"), out_of_range("99999999999999999999"));
  EXPECT_EQ(body("f 1 2 x"),
            "'part', line 4: 'x' is not a face corner (v, v/vt, v//vn or v/vt/vn); repair the line "
            "or export again");
  EXPECT_EQ(
      body("v 1 2"),
      "'part', line 4: a vertex has fewer than 3 coordinates; repair the line or export again");
  EXPECT_EQ(body("v 1 2 3,5"),
            "'part', line 4: '3,5' is not a coordinate; repair the line or export again");
  EXPECT_EQ(body("v 1 +inf nan"),
            "'part', line 4: vertex is not finite (1 inf nan); repair the mesh");
  std::string face = "f";
  for (int corner = 0; corner < 5000; ++corner) face += " 1";
  EXPECT_EQ(body(face),
            "'part', byte 24: a face has 5000 corners, at most 4096 are read; export triangles");
}

}  // namespace
}  // namespace vdbdither::test
