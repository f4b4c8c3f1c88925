#include "io/mesh/mesh_reader.h"

#include <cstdlib>
#include <filesystem>
#include <iostream>
#include <map>
#include <sys/stat.h>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "io/mesh/mesh_format.h"
#include "tests/support/mesh_files.h"
#include "tests/support/parsed_meshes.h"
#include "tests/support/scratch_folder.h"
#include "tests/support/shapes.h"
#include "vdbdither/model/errors.h"

namespace vdbdither::test {
namespace {

using openvdb::Vec3d;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

std::string refusalOfPath(const std::filesystem::path& path) {
  try {
    readMesh(path, {});
  } catch (const DataError& error) {
    return error.what();
  }
  return "read";
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

TEST(MeshReader, ReadsEveryFlavourAsTheSameMesh) {
  const ScratchFolder folder;
  const Mesh mesh = floatPart();
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
  const Mesh mesh = floatPart();
  expectSame(parse(objText(mesh), nullptr, "part.stl"), mesh);
  expectSame(parse(binaryStl(mesh), nullptr, "part.ply"), mesh);
  expectSame(parse(plyFile(mesh, PlyEncoding::kAscii), nullptr, "part.obj"), mesh);
}

TEST(MeshReader, TheSurestFormatReadsAFile) {
  const Mesh mesh = floatPart();
  // The size of a binary STL outweighs any beginning, and "solid" the name of another format.
  for (const char* header : {"ply\nformat", "solid", "{ }", "v 0 0 0"})
    expectSame(parse(binaryStl(mesh, header), nullptr, "part.obj"), mesh);
  expectSame(parse(asciiStl(mesh), nullptr, "part.obj"), mesh);
  EXPECT_THAT(refusal("{}", "part.obj"), HasSubstr("glTF"));
  // The name decides where the content does not.
  expectSame(parse("unheard of\n" + objText(mesh), nullptr, "part.OBJ"), mesh);
  EXPECT_THAT(refusal("unheard of\n" + objText(mesh)), HasSubstr("not a mesh"));
  EXPECT_THAT(refusal(std::string(100, '\0') + "...", "part.stl"), HasSubstr("no triangles"));
  EXPECT_THAT(refusal("text", "part.stl"), HasSubstr("not a mesh"));
  EXPECT_THAT(refusal("text", "part.vdb"), HasSubstr("a .vdb is no mesh"));
}

TEST(MeshReader, DropsVerticesWithoutATriangle) {
  const Mesh mesh = parseQuietly("v 9 9 9\nv 0 0 0\nv 1 0 0\nv 8 8 8\nv 0 1 0\nf 2 3 5\n");
  EXPECT_THAT(mesh.vertices, ElementsAre(Vec3d(0, 0, 0), Vec3d(1, 0, 0), Vec3d(0, 1, 0)));
  EXPECT_THAT(mesh.triangles, ElementsAre(Mesh::Triangle{0, 1, 2}));
}

TEST(MeshReader, RefusesWhatIsNoRegularFile) {
  const ScratchFolder folder;
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
  const ScratchFolder folder;
  const auto path = folder.write("part.stl", binaryStl(floatPart())) / "inner.stl";
  EXPECT_EQ(refusalOfPath(path), "'" + path.string() + "': cannot be opened: Not a directory");
}

TEST(MeshReader, NamesFormatsThatAreNotReadYet) {
  const auto expected = [](const std::string& format) {
    return "'part': " + format + " is not read yet; export " + meshFormatNames();
  };
  EXPECT_EQ(refusal("ISO-10303-21;\n"), expected("STEP"));
  EXPECT_EQ(refusal(std::string("\xFF\xFEs\0o\0", 6)), expected("text in UTF-16"));
  EXPECT_EQ(refusal("\xFE\xFF"), expected("text in UTF-16"));
  EXPECT_EQ(refusal("\x1F\x8B\x08"), expected("a gzip archive"));
  EXPECT_EQ(refusal("<?xml version=\"1.0\"?>"), expected("XML (AMF, COLLADA or X3D)"));
  EXPECT_EQ(refusal("#VRML V2.0 utf8\n"), expected("VRML"));
  EXPECT_EQ(refusal("# vtk DataFile Version 4.2\n"), expected("VTK"));
  EXPECT_EQ(refusal("Kaydara FBX Binary  "), expected("FBX"));
  const std::string unknown = "': not a mesh in a format that is read; export " + meshFormatNames();
  EXPECT_EQ(refusal("Dear reader,\n"), "'part" + unknown);
  EXPECT_EQ(refusal(std::string(1000, '\0')), "'part" + unknown);
  EXPECT_EQ(refusal("Dear reader,\n", "a\nb"), "'a?b" + unknown);
}

TEST(MeshReader, ATextMayBeFilledUpWithZerosButHasNoneWithin) {
  const Mesh mesh = floatPart();
  for (const std::string& text : {asciiStl(mesh), objText(mesh)}) {
    expectSame(parseQuietly(text + "\x1A"), mesh);
    expectSame(parseQuietly(text + std::string(3000, '\0')), mesh);
    const std::string begin = text + std::string(2000, '\n');
    EXPECT_EQ(refusal(begin + std::string(3, '\0') + text),
              "'part', byte " + std::to_string(begin.size()) +
                  ": a zero, so this is not a text; export it again");
  }
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

/// A file of zeros behind `begin`, which takes no room on the disk.
std::filesystem::path sparse(const ScratchFolder& folder, const std::string& begin,
                             std::uintmax_t size) {
  const auto path = folder.write("sparse.stl", begin);
  std::filesystem::resize_file(path, size);
  return path;
}

TEST(MeshReader, RefusesWhatAHeaderShowsToBeWrongBeforeItReadsTheFile) {
  // Larger than memory, so that reading it could not succeed.
  constexpr std::uintmax_t size = std::uintmax_t{1} << 35;
  const ScratchFolder folder;
  const std::string box = binaryStl(boxMesh({0, 0, 0}, {1, 1, 1}));
  const std::string ply =
      "ply\nformat binary_little_endian 1.0\nelement vertex 4294967294\n"
      "property double x\nproperty double y\nproperty double z\nend_header\n";
  const std::string counts = " triangles, which are not what its 34359738368 bytes hold";
  for (const auto& [begin, why] : std::map<std::string, std::string>{
           {"", "holds no triangles but zeros, as far as 65536 bytes tell"},
           {box, "its header announces 12" + counts},
           {box.substr(0, 80) + std::string("\0\0\0\x7F", 4) + box.substr(84),
            "the header announces 2130706432 triangles, the file holds 687194765"},
           {ply, "element 'vertex' counts more than the file holds, 4294967294"},
           {"OFF\n4294967294 9000000000 0\n", "more than the file holds: it is cut off"}}) {
    EXPECT_THAT(refusalOfPath(sparse(folder, begin, size)), HasSubstr(why));
  }
}

TEST(MeshReader, ReadsOrRefusesEveryPrefix) {
  for (const auto& [flavour, bytes] : flavours(boxMesh({0, 0, 0}, {1, 2, 3}))) {
    SCOPED_TRACE(flavour);
    expectEveryPrefixIsReadOrRefused(bytes, !flavour.starts_with("OBJ"));
  }
}

TEST(MeshReader, ReadsOrRefusesFilesWithFlippedBytes) {
  for (const auto& [flavour, bytes] : flavours(boxMesh({0, 0, 0}, {1, 2, 3}))) {
    SCOPED_TRACE(flavour);
    expectSpoiltBytesAreReadOrRefused(bytes);
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

}  // namespace
}  // namespace vdbdither::test
