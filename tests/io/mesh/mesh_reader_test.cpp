#include "io/mesh/mesh_reader.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <numbers>
#include <random>
#include <sys/stat.h>
#include <unistd.h>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "io/mesh/mesh_formats.h"
#include "io/mesh/polygon.h"
#include "tests/support/mesh_files.h"
#include "tests/support/shapes.h"
#include "vdbdither/model/errors.h"

namespace vdbdither::test {
namespace {

using openvdb::Vec3d;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using Warnings = std::vector<std::string>;

Mesh parse(const std::string& bytes, Warnings* warnings = nullptr,
           const std::string& name = "part") {
  return parseMesh(MeshFile(name, bytes, [&](const std::string& warning) {
    if (warnings != nullptr) warnings->push_back(warning);
  }));
}

/// Parses what must be fine: any warning fails the test.
Mesh parseQuietly(const std::string& bytes) {
  Warnings warnings;
  Mesh mesh = parse(bytes, &warnings);
  EXPECT_THAT(warnings, IsEmpty());
  return mesh;
}

std::string refusal(const std::string& bytes, const std::string& name = "part") {
  try {
    parse(bytes, nullptr, name);
  } catch (const DataError& error) {
    return error.what();
  }
  return "read";
}

std::string refusalOfPath(const std::filesystem::path& path) {
  try {
    readMesh(path, {});
  } catch (const DataError& error) {
    return error.what();
  }
  return "read";
}

/// A mesh whose coordinates are floats, vertices in the order of first use: so it survives every
/// format unchanged.
Mesh part() {
  Mesh mesh = transformed(sphereMesh({1.0, -2.0, 3.0}, 4.0, 5), {10, 20, 30}, {0.1, 0.2, 0.3});
  Mesh result;
  std::map<std::uint32_t, std::uint32_t> renamed;
  for (Mesh::Triangle triangle : mesh.triangles) {
    for (std::uint32_t& vertex : triangle) {
      const auto [place, is_new] =
          renamed.try_emplace(vertex, static_cast<std::uint32_t>(renamed.size()));
      if (is_new) result.vertices.emplace_back(openvdb::Vec3s(mesh.vertices[vertex]));
      vertex = place->second;
    }
    result.triangles.push_back(triangle);
  }
  return result;
}

void expectSame(const Mesh& mesh, const Mesh& expected) {
  EXPECT_EQ(mesh.vertices, expected.vertices);
  EXPECT_EQ(mesh.triangles, expected.triangles);
}

/// A small file of each flavour.
std::map<std::string, std::string> flavours(const Mesh& mesh) {
  return {{"binary STL", binaryStl(mesh)},
          {"ASCII STL", asciiStl(mesh)},
          {"ASCII STL, CRLF", asciiStl(mesh, "\r\n")},
          {"ASCII STL, CR", asciiStl(mesh, "\r")},
          {"OBJ", objText(mesh)},
          {"OBJ, CRLF", objText(mesh, "\r\n")},
          {"PLY, ASCII", plyFile(mesh, PlyEncoding::kAscii)},
          {"PLY, little endian", plyFile(mesh, PlyEncoding::kLittleEndian)},
          {"PLY, big endian", plyFile(mesh, PlyEncoding::kBigEndian)},
          {"PLY, little endian, double", plyFile(mesh, PlyEncoding::kLittleEndian, "double")},
          {"PLY, big endian, uint16", plyFile(mesh, PlyEncoding::kBigEndian, "float", "uint16")}};
}

class TemporaryFolder {
 public:
  TemporaryFolder() {
    std::string name = (std::filesystem::temp_directory_path() / "vdbdither_XXXXXX").string();
    path_ = ::mkdtemp(name.data());
  }
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;
  ~TemporaryFolder() { std::filesystem::remove_all(path_); }

  std::filesystem::path write(const std::string& name, const std::string& bytes) const {
    std::ofstream(path_ / name, std::ios::binary) << bytes;
    return path_ / name;
  }
  [[nodiscard]] const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

TEST(MeshReader, ReadsEveryFlavourAsTheSameMesh) {
  const TemporaryFolder folder;
  const Mesh mesh = part();
  for (const auto& [flavour, bytes] : flavours(mesh)) {
    SCOPED_TRACE(flavour);
    Warnings warnings;
    expectSame(readMesh(folder.write("part", bytes),
                        [&](const std::string& warning) { warnings.push_back(warning); }),
               mesh);
    EXPECT_THAT(warnings, IsEmpty());
  }
}

TEST(MeshReader, BelievesTheContentAndNotTheName) {
  const Mesh mesh = part();
  expectSame(parse(objText(mesh), nullptr, "part.stl"), mesh);
  expectSame(parse(binaryStl(mesh), nullptr, "part.ply"), mesh);
  expectSame(parse(plyFile(mesh, PlyEncoding::kAscii), nullptr, "part.obj"), mesh);
}

TEST(MeshReader, DropsVerticesWithoutATriangle) {
  const Mesh mesh = parseQuietly("v 9 9 9\nv 0 0 0\nv 1 0 0\nv 8 8 8\nv 0 1 0\nf 2 3 5\n");
  EXPECT_THAT(mesh.vertices, ElementsAre(Vec3d(0, 0, 0), Vec3d(1, 0, 0), Vec3d(0, 1, 0)));
  EXPECT_THAT(mesh.triangles, ElementsAre(Mesh::Triangle{0, 1, 2}));
}

TEST(MeshReader, RefusesWhatIsNoRegularFile) {
  const TemporaryFolder folder;
  const std::string pipe = (folder.path() / "pipe").string();
  ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
  const std::string name = folder.path().string();
  EXPECT_EQ(refusalOfPath(folder.path()),
            "'" + name + "': a folder; name the meshes in it, as in " + name + "/*.stl");
  EXPECT_EQ(refusalOfPath(pipe), "'" + name +
                                     "/pipe': a pipe or device; mesh input needs a regular file, "
                                     "save it first");
  EXPECT_EQ(refusalOfPath("/dev/null"),
            "'/dev/null': a pipe or device; mesh input needs a regular file, save it first");
  EXPECT_EQ(refusalOfPath(folder.path() / "none.stl"), "'" + name + "/none.stl': no such file");
  EXPECT_EQ(refusalOfPath(folder.write("empty.stl", "")),
            "'" + name + "/empty.stl': the file is empty; export it again");
}

TEST(MeshReader, SaysWhyAFileCannotBeOpened) {
  const TemporaryFolder folder;
  const auto path = folder.write("part.stl", binaryStl(part())) / "inner.stl";
  EXPECT_EQ(refusalOfPath(path), "'" + path.string() + "': cannot be opened: Not a directory");
}

TEST(MeshReader, NamesFormatsThatAreNotReadYet) {
  const auto expected = [](const std::string& format) {
    return "'part': " + format + " is not read yet; export STL, OBJ or PLY";
  };
  EXPECT_EQ(refusal("PK\x03\x04..."), expected("3MF (or another zip archive)"));
  EXPECT_EQ(refusal("glTF\x02"), expected("binary glTF (.glb)"));
  EXPECT_EQ(refusal(" \n{\n \"asset\": {}}"), expected("glTF (.gltf, or other JSON)"));
  EXPECT_EQ(refusal("DRACO\x02\x02"), expected("Draco (.drc)"));
  EXPECT_EQ(refusal("OFF\n3 1 0\n"), expected("OFF"));
  EXPECT_EQ(refusal("COFF\n3 1 0\n"), expected("OFF"));
  EXPECT_EQ(refusal("ISO-10303-21;\n"), expected("STEP"));
  const std::string unknown = "': not a mesh in a format that is read; export STL, OBJ or PLY";
  EXPECT_EQ(refusal("Dear reader,\n"), "'part" + unknown);
  EXPECT_EQ(refusal(std::string(1000, '\0')), "'part" + unknown);
  EXPECT_EQ(refusal("Dear reader,\n", "a\nb"), "'a?b" + unknown);
}

TEST(MeshReader, RefusesFilesWithoutTriangles) {
  const std::string expected = "'part': holds no triangles; export a surface mesh";
  EXPECT_EQ(refusal(binaryStl({})), expected);
  EXPECT_EQ(refusal("solid Empty\nendsolid Empty"), expected);
  EXPECT_EQ(refusal("# nothing\n"), expected);
  EXPECT_EQ(refusal("v 0 0 0\nv 1 0 0\nl 1 2\n"), expected);
  EXPECT_EQ(refusal("v 0 0 0\nv 1 0 0\nf 1 2\n"), expected);
  EXPECT_EQ(refusal("ply\nformat ascii 1.0\nend_header\n"), expected);
}

TEST(MeshReader, ReadsOrRefusesEveryPrefix) {
  for (const auto& [flavour, bytes] : flavours(boxMesh({0, 0, 0}, {1, 2, 3}))) {
    SCOPED_TRACE(flavour);
    for (std::size_t size = 0; size < bytes.size(); ++size) {
      const std::string message = refusal(bytes.substr(0, size));
      EXPECT_EQ(message.find('\n'), std::string::npos);
      // Formats that know where they end never pass off a half as the whole.
      if (!flavour.starts_with("OBJ") && message == "read") {
        EXPECT_THAT(parse(bytes.substr(0, size)).triangles, testing::SizeIs(12));
      }
    }
  }
}

TEST(MeshReader, ReadsOrRefusesFilesWithFlippedBytes) {
  std::mt19937 random(7);
  for (const auto& [flavour, bytes] : flavours(boxMesh({0, 0, 0}, {1, 2, 3}))) {
    SCOPED_TRACE(flavour);
    for (int round = 0; round < 2000; ++round) {
      std::string spoiled = bytes;
      for (int flips = 1 + static_cast<int>(random() % 4); flips > 0; --flips) {
        spoiled[random() % spoiled.size()] = static_cast<char>(random());
      }
      try {
        const Mesh mesh = parse(spoiled);
        for (const Vec3d& vertex : mesh.vertices) ASSERT_TRUE(isFinite(vertex));
        for (const Mesh::Triangle& triangle : mesh.triangles) {
          for (const std::uint32_t vertex : triangle) ASSERT_LT(vertex, mesh.vertices.size());
        }
      } catch (const DataError& error) {
        ASSERT_EQ(std::string(error.what()).find('\n'), std::string::npos);
      }
    }
  }
}

TEST(MeshReader, ReadsOrRefusesEveryModelOfTheFolderNamed) {
  const char* models = std::getenv("VDBDITHER_MODELS");
  if (models == nullptr) GTEST_SKIP() << "VDBDITHER_MODELS names no folder";
  for (const auto& entry : std::filesystem::recursive_directory_iterator(models)) {
    if (!entry.is_regular_file()) continue;
    const std::string name = entry.path().lexically_relative(models).string();
    try {
      const Mesh mesh = readMesh(entry.path(), [](const std::string& warning) {
        std::cout << "warning: " << warning << "\n";
      });
      std::cout << name << ": " << mesh.vertices.size() << " vertices, " << mesh.triangles.size()
                << " triangles\n";
    } catch (const DataError& error) {
      std::cout << error.what() << "\n";
      EXPECT_EQ(std::string(error.what()).find('\n'), std::string::npos);
    }
  }
}

TEST(Stl, WeldsEqualCornersAndNegativeZeroInOrderOfAppearance) {
  const Mesh apart{{{0.0, -0.0, 0.0}, {1, 0, 0}, {0, 1, 0}, {1, 0, 0}, {-0.0, 0.0, 0.0}, {0, 0, 1}},
                   {{0, 1, 2}, {3, 4, 5}}};
  for (const std::string& bytes : {binaryStl(apart), asciiStl(apart)}) {
    const Mesh mesh = parseQuietly(bytes);
    EXPECT_THAT(mesh.vertices,
                ElementsAre(Vec3d(0, 0, 0), Vec3d(1, 0, 0), Vec3d(0, 1, 0), Vec3d(0, 0, 1)));
    EXPECT_FALSE(std::signbit(mesh.vertices[0].y()));
    EXPECT_THAT(mesh.triangles, ElementsAre(Mesh::Triangle{0, 1, 2}, Mesh::Triangle{1, 0, 3}));
  }
}

TEST(Stl, KeepsPositionsApartThatDifferInTheLastBit) {
  const double next = std::nextafter(1.0F, 2.0F);
  const Mesh apart{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {next, 0, 0}}, {{0, 1, 2}, {0, 3, 2}}};
  EXPECT_THAT(parseQuietly(binaryStl(apart)).vertices, testing::SizeIs(4));
}

TEST(Stl, WeldsManyVerticesLikeAMap) {
  std::mt19937 random(3);
  Mesh soup;
  for (std::uint32_t i = 0; i < 30000; ++i) {
    soup.vertices.emplace_back(random() % 20, random() % 20, random() % 20 * 0.25);
    if (i % 3 == 2) soup.triangles.push_back({i - 2, i - 1, i});
  }
  const Mesh mesh = parseQuietly(binaryStl(soup));
  std::map<Vec3d, std::uint32_t> first;
  for (std::size_t i = 0; i < soup.triangles.size(); ++i) {
    for (std::size_t corner = 0; corner < 3; ++corner) {
      const auto [place, is_new] = first.try_emplace(soup.vertices[soup.triangles[i][corner]],
                                                     static_cast<std::uint32_t>(first.size()));
      ASSERT_EQ(mesh.triangles[i][corner], place->second);
    }
  }
  EXPECT_EQ(mesh.vertices.size(), first.size());
}

TEST(Stl, ReadsABinaryFileThatStartsLikeAnAsciiOne) {
  const Mesh mesh = part();
  expectSame(parseQuietly(binaryStl(mesh, "solid pretending to be text")), mesh);
  std::string longer = binaryStl(mesh, "solid pretending to be text") + "colour";
  Warnings warnings;
  expectSame(parse(longer, &warnings), mesh);
  EXPECT_THAT(warnings, ElementsAre("'part': ignored 6 bytes after the last triangle"));
}

TEST(Stl, ReadsAllTrianglesWhereTheCountWasNeverFilledIn) {
  const Mesh mesh = part();
  for (const char filler : {'\0', '\xFF'}) {
    std::string bytes = binaryStl(mesh);
    std::fill_n(bytes.begin() + 80, 4, filler);
    Warnings warnings;
    expectSame(parse(bytes, &warnings, "part.STL"), mesh);
    EXPECT_THAT(warnings,
                ElementsAre(HasSubstr(" triangles, the file holds 80: read all of them")));
  }
}

TEST(Stl, ReadsAllTrianglesWhereTheHeaderAnnouncesFewer) {
  std::string bytes = binaryStl(part());
  bytes[80] = 79;
  Warnings warnings;
  expectSame(parse(bytes, &warnings, "part.stl"), part());
  EXPECT_THAT(warnings, ElementsAre("'part.stl': the header announces 79 triangles, the file holds "
                                    "80: read all of them"));
}

TEST(Stl, RefusesABinaryFileThatIsCutOff) {
  const std::string bytes = binaryStl(boxMesh({0, 0, 0}, {1, 1, 1}));
  EXPECT_EQ(refusal(bytes.substr(0, 384), "part.stl"),
            "'part.stl', byte 384: cut off: the header announces 12 triangles, the file holds 6; "
            "export or download it again");
  EXPECT_EQ(
      refusal("solid" + std::string(20, '\0')),
      "'part': cut off: a binary STL has at least 84 bytes, this one has 25; export it again");
}

TEST(Stl, AHeaderThatAnnouncesFourBillionTrianglesIsRefused) {
  std::string bytes = binaryStl(boxMesh({0, 0, 0}, {1, 1, 1}));
  bytes[83] = '\x7F';
  EXPECT_THAT(refusal(bytes, "part.stl"), HasSubstr("announces 2130706444 triangles"));
}

TEST(Stl, RefusesCornersThatAreNotFinite) {
  Mesh mesh = boxMesh({0, 0, 0}, {1, 1, 1});
  mesh.vertices[7] = {0.5, std::nan(""), -std::numeric_limits<double>::infinity()};
  EXPECT_EQ(refusal(binaryStl(mesh)),
            "'part', byte 220: triangle 3 has a corner that is not finite (0.5 nan -inf); repair "
            "the mesh");
  EXPECT_EQ(refusal(asciiStl(mesh)),
            "'part', line 20: vertex is not finite (0.5 nan -inf); repair the mesh");
}

TEST(Stl, TakesSeveralSolidsAsOneMesh) {
  const Mesh box = boxMesh({0, 0, 0}, {1, 1, 1});
  Mesh both = box;
  for (const Vec3d& vertex : box.vertices) both.vertices.push_back(vertex + Vec3d(1, 0, 0));
  for (const auto& [a, b, c] : box.triangles) both.triangles.push_back({a + 8, b + 8, c + 8});
  const Mesh mesh = parseQuietly(asciiStl(box) + "solid\nendsolid\n" +
                                 asciiStl(transformed(box, {0, 0, 0}, {1, 0, 0})));
  EXPECT_THAT(mesh.vertices, testing::SizeIs(12));
  expectSame(mesh, parseQuietly(binaryStl(both)));
}

TEST(Stl, ToleratesCapitalsTabsRemarksAndAMissingFinalNewline) {
  const Mesh mesh = parseQuietly(
      "\xEF\xBB\xBF  SOLID C:\\parts\\\n\tFacet Normal 0 0 1\nOUTER LOOP\n\n  Vertex +1 .5 0\n"
      "vertex\t1e0\t2.E1   3 \nvertex 0 -0 1e-400\nendloop foo\nENDFACET bar\nEndSolid no more");
  EXPECT_THAT(mesh.vertices, ElementsAre(Vec3d(1, 0.5, 0), Vec3d(1, 20, 3), Vec3d(0, 0, 0)));
}

TEST(Stl, RefusesAsciiThatIsNotAsItShouldBe) {
  const auto body = [](const std::string& lines) { return refusal("solid x\n" + lines); };
  const std::string loop = "facet normal 0 0 1\nouter loop\n";
  const std::string corners = "vertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\n";
  EXPECT_EQ(body(loop + corners + "endloop\nendfacet\n"),
            "'part', line 9: cut off: the file ends without 'endsolid'; export or download it "
            "again");
  EXPECT_EQ(body(loop + corners + "vertex 1 1 0\nendloop\n"),
            "'part', line 8: a facet has 4 corners instead of 3; export triangles only");
  EXPECT_EQ(body(loop + "vertex 0 0\n"),
            "'part', line 4: a vertex is not three numbers; repair the line or export again");
  EXPECT_EQ(body(loop + "vertex 0 0,5 1\n"),
            "'part', line 4: a vertex is not three numbers; repair the line or export again");
  EXPECT_EQ(body(loop + "vertex 0 1e999 1\n"),
            "'part', line 4: vertex is not finite (0 inf 1); repair the mesh");
  EXPECT_EQ(body(corners), "'part', line 2: vertex outside of a loop; export it again");
  EXPECT_EQ(body(loop + corners + "endfacet\n"),
            "'part', line 7: the loop before is not closed; export it again");
  EXPECT_EQ(body("facets\n"),
            "'part', line 2: 'facets' is no keyword of STL; repair the line or export again");
}

TEST(Obj, UnderstandsEveryFormOfACorner) {
  const std::string vertices = "v 0 0 0 1\nv 1 0 0 0.5 0.5 0.5\nv 0 1 0\nvt 0 0\nvn 0 0 1\n";
  for (const char* face : {"f 1 2 3", "f 1/1 2/1 3/1", "f 1//1 2//1 3//1", "f 1/1/1 2/1/1 3/1/1",
                           "f -3 -2 -1", "f -3/-1/-1 2/1 3", "f 1 \\\n 2\\\n 3", "f\t1\t2\t3\t"}) {
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
  EXPECT_EQ(body("f 1 2 4"), out_of_range("4"));
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
  const std::string bytes = plyFile(part(), PlyEncoding::kBigEndian) + "more";
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

double area(const std::vector<Vec3d>& points, const Mesh::Triangle& triangle) {
  return (points[triangle[1]] - points[triangle[0]])
      .cross(points[triangle[2]] - points[triangle[0]])
      .z();
}

/// Triangles of a polygon without self-crossings cover it exactly if and only if none is turned
/// over: their signed areas add up to the polygon's in any case.
void expectCover(const std::vector<Vec3d>& points, const std::vector<std::uint32_t>& polygon) {
  std::vector<Mesh::Triangle> triangles;
  triangulate(points, polygon, triangles);
  ASSERT_EQ(triangles.size(), polygon.size() - 2);
  for (const Mesh::Triangle& triangle : triangles) EXPECT_GE(area(points, triangle), 0.0);
}

TEST(Polygon, TriangulatesConcavePolygonsWithoutTurningATriangleOver) {
  std::mt19937 random(11);
  for (int round = 0; round < 300; ++round) {
    const std::uint32_t corners = 4 + random() % 60;
    std::vector<Vec3d> points;
    std::vector<std::uint32_t> polygon;
    for (std::uint32_t i = 0; i < corners; ++i) {
      const double angle = 2 * std::numbers::pi * i / corners;
      const double radius = 0.1 + static_cast<double>(random() % 1000);
      points.emplace_back(1e4 + radius * std::cos(angle), radius * std::sin(angle), 0.0);
      polygon.push_back(i);
    }
    expectCover(points, polygon);
  }
}

TEST(Polygon, TriangulatesAroundAHoleJoinedByASlit) {
  std::mt19937 random(13);
  for (int round = 0; round < 300; ++round) {
    const std::uint32_t corners = 3 + random() % 20;
    std::vector<Vec3d> points;
    std::vector<std::uint32_t> polygon;
    for (std::uint32_t i = 0; i < corners; ++i) {
      const double angle = 2 * std::numbers::pi * i / corners;
      const double radius = 5.0 + static_cast<double>(random() % 100);
      points.emplace_back(radius * std::cos(angle), radius * std::sin(angle), 0.0);
      polygon.push_back(i);
    }
    polygon.push_back(0);
    for (std::uint32_t i = 0; i <= corners; ++i) {  // the hole runs the other way, and returns
      polygon.push_back(corners + (corners - i) % corners);
    }
    for (std::uint32_t i = 0; i < corners; ++i) points.push_back(points[i] * 0.5);
    expectCover(points, polygon);
  }
}

TEST(Polygon, LiesInAnyPlane) {
  const std::vector<Vec3d> arrow{{0, 0, 0}, {4, 2, 0}, {0, 4, 0}, {1, 2, 0}};
  std::vector<Mesh::Triangle> flat;
  triangulate(arrow, std::vector<std::uint32_t>{0, 1, 2, 3}, flat);
  for (const Vec3d& degrees : {Vec3d(90, 0, 0), Vec3d(180, 0, 0), Vec3d(0, 90, 0), Vec3d(0, -90, 0),
                               Vec3d(35, 50, 70), Vec3d(-90, 0, 0)}) {
    const Mesh turned = transformed({arrow, {}}, degrees, {1, 2, 3});
    std::vector<Mesh::Triangle> triangles;
    triangulate(turned.vertices, std::vector<std::uint32_t>{0, 1, 2, 3}, triangles);
    EXPECT_EQ(triangles, flat);
  }
}

TEST(Polygon, KeepsTheNumberOfTrianglesOfASenselessPolygon) {
  const std::vector<Vec3d> points{{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 1}};
  std::vector<std::uint32_t> polygon;
  for (std::uint32_t i = 0; i < 400; ++i) polygon.push_back(i * i % 4);
  std::vector<Mesh::Triangle> triangles;
  triangulate(points, polygon, triangles);
  EXPECT_THAT(triangles, testing::SizeIs(398));
}

}  // namespace
}  // namespace vdbdither::test
