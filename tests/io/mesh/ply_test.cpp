#include <regex>
#include <string>

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

/// A closed mesh as a text with other lines in place of those of its header, vertices or faces.
std::string changed(const std::string& from, const std::string& to) {
  return std::regex_replace(plyFile(floatPart(), PlyEncoding::kAscii), std::regex(from), to);
}

TEST(Ply, UnderstandsWhatWritersPutIntoHeaders) {
  for (const char* start : {"ply \n", "ply\t\r\n", "ply\n\n", "ply\ncomment C:\\a\\\n",
                            "ply\nobj_info num_cols 512\ncomment\n"}) {
    SCOPED_TRACE(start);
    expectSame(parseQuietly(changed("ply\n", start)), floatPart());
  }
  expectSame(parseQuietly(changed("end_header", "end_header \t")), floatPart());
  for (const char* type : {"int64", "uint64", "double", "uint8"})
    expectSame(parseQuietly(changed("uchar int", "uchar " + std::string(type))), floatPart());
  EXPECT_THAT(refusal("plywood\n"), HasSubstr("not a mesh"));
  EXPECT_THAT(refusal("ply"), HasSubstr("not a mesh"));
}

TEST(Ply, ReadsIndicesOfEightBytes) {
  const Mesh mesh = boxMesh({0, 0, 0}, {1, 2, 3});
  for (const PlyEncoding encoding : {PlyEncoding::kLittleEndian, PlyEncoding::kBigEndian}) {
    const std::string narrow = plyFile(mesh, encoding);
    const std::size_t faces = narrow.size() - 13 * mesh.triangles.size();
    for (const char* type : {"int64", "uint64"}) {
      std::string wide = std::regex_replace(narrow.substr(0, faces), std::regex("uchar int"),
                                            "uchar " + std::string(type));
      for (std::size_t face = faces; face < narrow.size(); face += 13) {
        wide += '\3';
        for (std::size_t corner = face + 1; corner < face + 13; corner += 4) {
          const bool is_little = encoding == PlyEncoding::kLittleEndian;
          if (!is_little) wide.append(4, '\0');
          wide += narrow.substr(corner, 4);
          if (is_little) wide.append(4, '\0');
        }
      }
      expectSame(parseQuietly(wide), mesh);
      wide.replace(wide.size() - 8, 8, 8, '\xFF');
      EXPECT_THAT(refusal(wide), HasSubstr("a vertex index is out of range"));
    }
  }
}

TEST(Ply, FacesMayComeBeforeTheirVertices) {
  const Mesh mesh = boxMesh({0, 0, 0}, {1, 2, 3});
  for (const PlyEncoding encoding :
       {PlyEncoding::kAscii, PlyEncoding::kLittleEndian, PlyEncoding::kBigEndian}) {
    const std::string bytes = plyFile(mesh, encoding);
    const std::size_t vertex = bytes.find("element vertex");
    const std::size_t face = bytes.find("element face");
    const std::size_t body = bytes.find("end_header\n") + 11;
    const std::size_t faces = encoding == PlyEncoding::kAscii
                                  ? bytes.find("\n3 ") + 1
                                  : bytes.size() - 13 * mesh.triangles.size();
    const std::string turned = bytes.substr(0, vertex) + bytes.substr(face, body - 11 - face) +
                               bytes.substr(vertex, face - vertex) + "end_header\n" +
                               bytes.substr(faces) + bytes.substr(body, faces - body);
    expectSame(parseQuietly(turned), mesh);
    EXPECT_NE(refusal(turned.substr(0, turned.size() - 2)), "read");
  }
}

TEST(Ply, IgnoresWhatLinesHaveBehindTheirProperties) {
  for (const char* more : {" 0 0", " 255 128 0", " # red", " 7"}) {
    Warnings warnings;
    expectSame(parse(changed("(\n3 [^\n]*)", "$1" + std::string(more)), &warnings), floatPart());
    EXPECT_THAT(warnings,
                ElementsAre(HasSubstr(": ignored what 80 lines, from here on, have behind the "
                                      "properties that the header declares")));
  }
  Warnings warnings;
  expectSame(parse(changed("(end_header\n[^\n]*)", "$1 0.5 0.5 0.5"), &warnings), floatPart());
  EXPECT_THAT(warnings, ElementsAre("'part', line 11: ignored what 1 lines, from here on, have "
                                    "behind the properties that the header declares"));
}

TEST(Ply, CommentsMayStandInTheBody) {
  for (const char* remark : {"comment 3 0 1 2", "obj_info x", "# faces"})
    expectSame(parseQuietly(changed("\n(3 [^\n]*)", "\n" + std::string(remark) + "\n$1")),
               floatPart());
  expectSame(parseQuietly(plyFile(floatPart(), PlyEncoding::kAscii) + "comment end\n"),
             floatPart());
}

TEST(Ply, ReadsTextByWordsWhereLinesAreNoElements) {
  expectSame(parseQuietly(changed("\n3 ", "\n3\n")), floatPart());
  const std::string text = plyFile(floatPart(), PlyEncoding::kAscii);
  const std::size_t body = text.find("end_header\n") + 11;
  expectSame(parseQuietly(text.substr(0, body) +
                          std::regex_replace(text.substr(body), std::regex("\n"), " ")),
             floatPart());
}

TEST(Ply, TheBodyTellsWhichLineEndEndsTheHeader) {
  const Mesh mesh = boxMesh({0, 0, 0}, {1, 2, 3});
  for (const PlyEncoding encoding : {PlyEncoding::kLittleEndian, PlyEncoding::kBigEndian}) {
    const std::string bytes = plyFile(mesh, encoding);
    const std::size_t body = bytes.find("end_header\n") + 11;
    const std::string header = bytes.substr(0, body - 11);
    for (const char* lines : {"\n", "\r\n", "\r"}) {
      for (const char* last : {"\n", "\r\n", "\r"}) {
        expectSame(parseQuietly(std::regex_replace(header, std::regex("\n"), lines) + "end_header" +
                                last + bytes.substr(body)),
                   mesh);
      }
    }
  }
}

TEST(Ply, BytesBehindAnOpenMeshMeanThatItWasMisread) {
  Mesh open = boxMesh({0, 0, 0}, {1, 2, 3});
  open.triangles.pop_back();
  for (const PlyEncoding encoding : {PlyEncoding::kAscii, PlyEncoding::kBigEndian}) {
    const std::string bytes = plyFile(open, encoding);
    EXPECT_THAT(refusal(bytes + "1 2 3\n4"),
                HasSubstr("bytes follow the last element and the triangles before do not close: "
                          "the file is not as its header says; export it again"));
    EXPECT_EQ(parse(bytes + "\n \n").triangles, open.triangles);
  }
  // A colour that the header does not declare.
  std::string bytes = plyFile(open, PlyEncoding::kLittleEndian);
  for (std::size_t face = 11; face > 0; --face) bytes.insert(bytes.size() - 13 * (face - 1), "abc");
  EXPECT_NE(refusal(bytes), "read");
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
  EXPECT_EQ(refused("element vertex\n"),
            "'part', line 3: element 'vertex' has no count; export it again");
  for (const std::string count : {"-1", "100000000000000000000", "many"})
    EXPECT_EQ(refused("element vertex " + count + "\n"),
              "'part', line 3: element 'vertex' has the count '" + count +
                  "', which must be a whole number from 0 on; export it again");
  EXPECT_EQ(refused("element vertex 1\nelement vertex 2\n"),
            "'part', line 4: element 'vertex' is declared twice; export it again");
  EXPECT_EQ(refused("property int x\n"),
            "'part', line 3: a property before any element; export it again");
  EXPECT_EQ(refused("element vertex 1\nproperty long x\n"),
            "'part', line 4: 'long' is no scalar type of PLY; export it again");
  EXPECT_EQ(refused("element vertex 1\nproperty int\n"),
            "'part', line 4: a property has no name; export it again");
  EXPECT_EQ(refused("elements vertex 1\n"),
            "'part', line 3: 'elements' is not a keyword of a PLY header; export it again");
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
  EXPECT_EQ(refused("0 0 0\n1 0 0 0 1 0 3 0 1"),
            "'part', line 11: face 1 of 1: cut off here; export or download it again");
  EXPECT_EQ(refused("0 0 0\n1 0\n0 0 1 0\n3 0 1 2"),
            "'part', line 11: vertex 2 of 3: its line has fewer numbers than it should; export or "
            "download it again");
  for (const char* face : {"3 0 1 3", "3 0 1 -1", "3 0 1 0.5", "3 0 1 nan"}) {
    EXPECT_EQ(refused(vertices + face),
              "'part', line 13: face 1 of 1: a vertex index is out of range: 3 vertices, counted "
              "from 0; export it again");
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
  const auto refused = [](const std::string& format, const std::string& counts) {
    return refusal("ply\nformat " + format + " 1.0\nelement nothing 18446744073709551615\n" +
                   counts + "end_header\n0 0 0\n");
  };
  const std::string vertices =
      "element vertex 4294967294\nproperty float x\nproperty float y\nproperty float z\n";
  EXPECT_THAT(refused("ascii", vertices),
              HasSubstr("of 4294967294: cut off here; export or download it again"));
  EXPECT_EQ(refused("binary_little_endian", vertices),
            "'part', line 4: cut off: element 'vertex' counts more than the file holds, "
            "4294967294; export or download it again");
  EXPECT_THAT(refused("binary_big_endian",
                      "element face 18446744073709551615\nproperty list uint8 int "
                      "vertex_indices\nproperty double quality\n"),
              HasSubstr("element 'face' counts more than the file holds, 18446744073709551615"));
}

}  // namespace
}  // namespace vdbdither::test
