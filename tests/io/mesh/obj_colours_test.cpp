#include <filesystem>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "io/image/srgb.h"
#include "tests/support/parsed_meshes.h"
#include "tests/support/scratch_folder.h"
#include "tests/support/textures.h"

namespace vdbdither::test {
namespace {

using openvdb::Vec2f;
using openvdb::Vec4f;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

float linear(double encoded) { return static_cast<float>(linearOfSrgb(encoded)); }
Vec4f light(double red, double green, double blue, double opacity = 1) {
  return {linear(red), linear(green), linear(blue), static_cast<float>(opacity)};
}

const std::string triangle = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
const std::string corners = "vt 0 0\nvt 1 0\nvt 0 1\n";

/// Files in a folder of their own.
class ObjColoursTest : public testing::Test {
 protected:
  ObjColoursTest() {
    scratch_.write("tex.png", textOf(pngOf(pattern(4, 2, 3))));
    scratch_.write("other tex.png", textOf(pngOf(pattern(3, 5, 4))));
  }

  Mesh read(const std::string& obj) {
    warnings_.clear();
    return parseWithColours(obj, &warnings_, name());
  }
  [[nodiscard]] std::string refused(const std::string& obj) const {
    return refusalWithColours(obj, name());
  }
  [[nodiscard]] std::string name() const { return (scratch_ / "part.obj").string(); }
  void writeLibrary(const std::string& text) const { scratch_.write("part.mtl", text); }
  /// The material of the only triangle.
  SurfaceMaterial only(const std::string& library) {
    writeLibrary("newmtl a\n" + library);
    const Mesh mesh = read("mtllib part.mtl\n" + triangle + corners + "usemtl a\nf 1/1 2/2 3/3\n");
    EXPECT_NE(mesh.appearance, nullptr);
    EXPECT_EQ(mesh.appearance->materials.size(), 1U);
    return mesh.appearance->materials.at(mesh.appearance->material.at(0));
  }

  ScratchFolder scratch_;
  Warnings warnings_;
};

TEST_F(ObjColoursTest, ReadsColoursOfVertices) {
  const std::string obj =
      "v 0 0 0 0.5 0 1\nv 1 0 0 0 0.25 0\nv 0 1 0 1 1 1 0.5\nv 1 1 0\nf 1 2 3\nf 2 4 3\n";
  const Mesh mesh = read(obj);
  EXPECT_THAT(warnings_, IsEmpty());
  ASSERT_NE(mesh.appearance, nullptr);
  EXPECT_THAT(mesh.appearance->colours.at(0),
              ElementsAre(light(0.5, 0, 1), light(0, 0.25, 0), light(1, 1, 1, 0.5)));
  // A triangle with a vertex that has none.
  EXPECT_THAT(mesh.appearance->colours.at(1), ElementsAre(Vec4f(1), Vec4f(1), Vec4f(1)));
  EXPECT_EQ(parse(obj).appearance, nullptr) << "not asked for";
}

TEST_F(ObjColoursTest, TellsBytesFromSharesAndWeightsFromColours) {
  const Mesh mesh = read("v 0 0 0 255 0 51\nv 1 0 0 1 0 0\nv 0 1 0 300 -5 nan\nf 1 2 3\n");
  EXPECT_THAT(warnings_, ElementsAre(HasSubstr("colours of vertices go beyond 1; they are read as "
                                               "0 to 255")));
  EXPECT_THAT(mesh.appearance->colours.at(0),
              ElementsAre(light(1, 0, 0.2), light(1 / 255.0, 0, 0), light(1, 0, 0)));
  EXPECT_EQ(read("v 0 0 0 1\nv 1 0 0 1\nv 0 1 0 0.5\nf 1 2 3\n").appearance, nullptr);
}

TEST_F(ObjColoursTest, ReadsKdAndOpacity) {
  EXPECT_EQ(only("Kd 0.5 0.25 1\n").colour, light(0.5, 0.25, 1));
  EXPECT_EQ(only("Kd 0.5\n").colour, light(0.5, 0.5, 0.5));
  EXPECT_EQ(only("kd 0.5 1.5 0 # red\n").colour, light(0.5, 1, 0));
  EXPECT_EQ(only("d 0.25\n").colour, light(1, 1, 1, 0.25));
  EXPECT_EQ(only("Tr 0.25\n").colour, light(1, 1, 1, 0.75));
  EXPECT_EQ(only("Tr 0.25\nd 1\n").colour, light(1, 1, 1, 1));
  EXPECT_EQ(only("d -halo 0.5\nTr 1\n").colour, light(1, 1, 1, 0.5));
  EXPECT_EQ(only("Ns 5\nillum 2\nKs 1 1 1\n").name, "a");
  EXPECT_THAT(warnings_, IsEmpty());
}

TEST_F(ObjColoursTest, ReadsKdOfBytes) {
  EXPECT_EQ(only("Kd 51 255 0\nnewmtl b\nKd 0 0 0\nmap_Kd tex.png\n").colour, light(0.2, 1, 0));
  EXPECT_THAT(warnings_,
              ElementsAre(HasSubstr("'part.mtl': Kd goes beyond 1; it is read as 0 to 255"),
                          HasSubstr("are black with a texture")));
}

TEST_F(ObjColoursTest, RefusesColoursThatAreNoNumbers) {
  const auto refusal = [&](const std::string& library) {
    writeLibrary("newmtl a\n" + library);
    return refused("mtllib part.mtl\n" + triangle + "usemtl a\nf 1 2 3\n");
  };
  const std::string three = "Kd needs three numbers from 0 to 1, not ";
  EXPECT_THAT(refusal("Ns 5\nKd 0,5 0,25 1\n"),
              HasSubstr("material library 'part.mtl', line 3: " + three +
                        "'0,5'; repair the line or export again"));
  EXPECT_THAT(refusal("Kd\n"), HasSubstr("line 2: " + three + "nothing"));
  EXPECT_THAT(refusal("Kd 1 x\n"), HasSubstr(three + "'x'"));
  EXPECT_THAT(refusal("Kd nan 0 0\n"), HasSubstr(three + "'nan'"));
  EXPECT_THAT(refusal("Kd 0 0 -1\n"), HasSubstr(three + "'-1'"));
  EXPECT_THAT(refusal("d abc\n"), HasSubstr("line 2: d needs one number from 0 to 1, not 'abc'"));
  EXPECT_THAT(refusal("Tr inf\n"), HasSubstr("Tr needs one number from 0 to 1, not 'inf'"));
}

TEST_F(ObjColoursTest, FindsFilesInOtherCases) {
  scratch_.write("Lib.MTL", "newmtl a\nKd 1 0 0\nmap_Kd TEX.PNG\n");
  const std::string faces = triangle + corners + "usemtl a\nf 1/1 2/2 3/3\n";
  EXPECT_EQ(read("mtllib lib.mtl\n" + faces).appearance->textures.at(0).width, 4U);
  EXPECT_EQ(read("mtllib \"LIB.mtl\"\n" + faces).appearance->textures.size(), 1U);
  scratch_.write("LIB.MTL", "newmtl a\nKd 0 1 0\n");
  EXPECT_THAT(read("mtllib Lib.MTL\n" + faces).appearance->textures, testing::SizeIs(1));
  EXPECT_EQ(read("mtllib lib.mtl\n" + faces).appearance->textures.size(), 0U);
}

TEST_F(ObjColoursTest, GivesEveryTriangleItsMaterial) {
  writeLibrary("newmtl red\nKd 1 0 0\nnewmtl my green # a comment\nKd 0 1 0\n");
  const Mesh mesh = read("mtllib part.mtl\nf 1 2 3\nusemtl red\nf 1 2 3 4\nusemtl my green\n" +
                         triangle + "v 1 1 0\nf 1 2 3\nusemtl red # again\nf 1 2 3\n");
  EXPECT_THAT(warnings_, IsEmpty());
  std::vector<Vec4f> colours;
  colours.reserve(mesh.triangles.size());
  for (const std::uint32_t material : mesh.appearance->material)
    colours.push_back(mesh.appearance->materials[material].colour);
  const Vec4f red = light(1, 0, 0);
  EXPECT_THAT(colours, ElementsAre(Vec4f(1), red, red, light(0, 1, 0), red));
  EXPECT_EQ(mesh.appearance->materials.size(), 3U);
}

TEST_F(ObjColoursTest, ReadsTexturesWithTheirCoordinates) {
  const SurfaceMaterial material = only("Kd 0.5 0.5 0.5\nmap_Kd tex.png\n");
  EXPECT_EQ(material.colour, light(0.5, 0.5, 0.5));
  EXPECT_EQ(material.wrap[0], TextureWrap::repeat);
  writeLibrary("newmtl a\nmap_Kd tex.png\nnewmtl b\nmap_Kd other tex.png\n");
  const Mesh mesh = read("mtllib part.mtl\nusemtl a\n" + triangle + "v 1 1 0\n" + corners +
                         "vt 1 0.25\nf 1/1/9 2/2 4/-1 3/3\nusemtl b\nf 1/1 2/2 3/3\n");
  EXPECT_THAT(warnings_, IsEmpty());
  const Appearance& appearance = *mesh.appearance;
  ASSERT_EQ(appearance.textures.size(), 2U);
  EXPECT_EQ(appearance.textures[0].texels, decoded(pngOf(pattern(4, 2, 3))).texels);
  EXPECT_EQ(appearance.textures[1].texels, decoded(pngOf(pattern(3, 5, 4))).texels);
  EXPECT_EQ(appearance.materials[appearance.material[2]].texture, 1U);
  // v is stored from top to bottom.
  EXPECT_THAT(appearance.coordinates[0], ElementsAre(Vec2f(0, 1), Vec2f(1, 1), Vec2f(1, 0.75)));
  EXPECT_THAT(appearance.coordinates[1], ElementsAre(Vec2f(0, 1), Vec2f(1, 0.75), Vec2f(0, 0)));
}

TEST_F(ObjColoursTest, CoordinatesFollowTheCornersOfConcavePolygons) {
  writeLibrary("newmtl a\nmap_Kd tex.png\n");
  const Mesh mesh = read(
      "mtllib part.mtl\nusemtl a\nv 0 0 0\nv 4 0 0\nv 4 4 0\nv 3 1 0\nv 0 3 0\n"
      "vt 0 0\nvt 4 0\nvt 4 4\nvt 3 1\nvt 0 3\nf 2/2 3/3 4/4 5/5 1/1\n");
  ASSERT_EQ(mesh.triangles.size(), 3U);
  for (std::size_t t = 0; t < 3; ++t) {
    for (std::size_t c = 0; c < 3; ++c) {
      const openvdb::Vec3d& at = mesh.vertices[mesh.triangles[t][c]];
      EXPECT_EQ(mesh.appearance->coordinates[t][c],
                Vec2f(static_cast<float>(at.x()), static_cast<float>(1 - at.y())));
    }
  }
}

TEST_F(ObjColoursTest, HonoursTheOptionsOfMaps) {
  const SurfaceMaterial material = only(
      "map_Kd -blendu on -blendv off -cc on -clamp on -mm 0 1 -o 0.5 0.25 0 -s 2 3 1 -t 0 0 0 "
      "-texres 512 -bm 1 -boost 2 -imfchan r -type sphere other tex.png\n");
  EXPECT_THAT(warnings_, IsEmpty());
  EXPECT_EQ(material.wrap[0], TextureWrap::clamp);
  EXPECT_EQ(material.wrap[1], TextureWrap::clamp);
  writeLibrary("newmtl a\nmap_Kd -s 2 3 -o 0.5 0.25 tex.png\n");
  const Mesh mesh = read("mtllib part.mtl\n" + triangle + corners + "usemtl a\nf 1/1 2/2 3/3\n");
  EXPECT_THAT(mesh.appearance->coordinates[0],
              ElementsAre(Vec2f(0.5F, 0.75F), Vec2f(2.5F, 0.75F), Vec2f(0.5F, -2.25F)));
}

TEST_F(ObjColoursTest, NamesWhatItDoesNotReadOfALibrary) {
  only("Kd spectral a.rfl\nmap_Kd -mm 0.1 2 -t 1 tex.png\nmap_d tex.png\nmap_Kd\n");
  EXPECT_THAT(warnings_,
              ElementsAre(HasSubstr("material library 'part.mtl': not read: Kd spectral, map_Kd "
                                    "without the name of a file, map_d, the option -mm of map_Kd, "
                                    "the option -t of map_Kd")));
  EXPECT_EQ(only("Kd 0 0 0\nmap_Kd tex.png\n").colour, Vec4f(1));
  EXPECT_THAT(warnings_, ElementsAre(HasSubstr("1 materials, the first 'a', are black with a "
                                               "texture; their textures are read as they are")));
}

TEST_F(ObjColoursTest, FindsTexturesByForeignPathsAndBesideTheirLibrary) {
  EXPECT_EQ(only("map_Kd C:\\Users\\me\\tex.png\n").texture, 0U);
  EXPECT_EQ(only("map_Kd \"other tex.png\"\n").texture, 0U);
  EXPECT_EQ(only("map_Kd .\\tex.png\r\n").texture, 0U);
  std::filesystem::create_directory(scratch_ / "sub");
  scratch_.write("sub/beside.png", textOf(pngOf(pattern(6, 2, 3))));
  scratch_.write("sub/far.mtl", "newmtl a\nmap_Kd beside.png\n");
  const Mesh mesh =
      read("mtllib sub\\far.mtl\n" + triangle + corners + "usemtl a\nf 1/1 2/2 3/3\n");
  EXPECT_EQ(mesh.appearance->textures.at(0).width, 6U);
}

TEST_F(ObjColoursTest, ReadsSeveralLibrariesAndNamesWithBlanks) {
  scratch_.write("my part.mtl", "newmtl a\nKd 1 0 0\n");
  scratch_.write("b.mtl", "newmtl b\nKd 0 1 0\n");
  scratch_.write("c.mtl", "newmtl c\nKd 0 0 1\nnewmtl a\nKd 0 0 1\n");
  const Mesh mesh = read("mtllib my part.mtl\nmtllib b.mtl c.mtl\n" + triangle +
                         "usemtl a\nf 1 2 3\nusemtl b\nf 1 2 3\nusemtl c\nf 1 2 3\n");
  EXPECT_THAT(warnings_, IsEmpty());
  std::vector<Vec4f> colours;
  colours.reserve(mesh.appearance->materials.size());
  for (const SurfaceMaterial& material : mesh.appearance->materials)
    colours.push_back(material.colour);
  EXPECT_THAT(colours, ElementsAre(light(1, 0, 0), light(0, 1, 0), light(0, 0, 1)));
}

TEST_F(ObjColoursTest, AMissingLibraryIsToldAndWhite) {
  const Mesh mesh = read("mtllib none.mtl\nmtllib none.mtl\n" + triangle + "usemtl a\nf 1 2 3\n");
  EXPECT_THAT(warnings_, ElementsAre(HasSubstr("the material library 'none.mtl' is not in the "
                                               "folder of the mesh; its materials are white")));
  EXPECT_EQ(mesh.appearance, nullptr);
  EXPECT_THAT(parseQuietly("mtllib none.mtl\n" + triangle + "usemtl a\nf 1 2 3\n").triangles,
              testing::SizeIs(1));
}

TEST_F(ObjColoursTest, LimitsTheNumberOfLibraries) {
  std::string many = "mtllib";
  for (int i = 0; i < 900; ++i) many += " a" + std::to_string(i);
  const std::string face = "\n" + triangle + "usemtl a\nf 1 2 3\n";
  read(many + face);
  EXPECT_THAT(warnings_,
              ElementsAre(HasSubstr("900 material libraries, the first 'a0', are not in "
                                    "the folder of the mesh; their materials are white")));
  for (int i = 900; i < 1100; ++i) many += " a" + std::to_string(i);
  EXPECT_THAT(refused(many + face),
              HasSubstr("it names more than 1000 material libraries; export it again"));
}

TEST_F(ObjColoursTest, AMissingMaterialIsToldAndWhite) {
  writeLibrary("newmtl a\nKd 1 0 0\n");
  const Mesh mesh = read("mtllib part.mtl\n" + triangle + "usemtl a\nf 1 2 3\nusemtl b\nf 1 2 3\n");
  EXPECT_THAT(warnings_, ElementsAre(HasSubstr("1 materials, the first 'b', are in no material "
                                               "library; they are white")));
  EXPECT_EQ(mesh.appearance->materials.at(mesh.appearance->material.at(1)).colour, Vec4f(1));
}

TEST_F(ObjColoursTest, TheMostSpecificColourCounts) {
  writeLibrary("newmtl plain\nKd 1 0 0\nd 0.5\nnewmtl picture\nmap_Kd tex.png\n");
  const std::string coloured = "v 0 0 0 0 1 0\nv 1 0 0 0 1 0\nv 0 1 0 0 1 0\n";
  const Mesh mesh = read("mtllib part.mtl\n" + coloured + corners +
                         "usemtl plain\nf 1 2 3\nusemtl picture\nf 1/1 2/2 3/3\nf 1 2 3\n");
  const Appearance& appearance = *mesh.appearance;
  EXPECT_EQ(appearance.materials[appearance.material[0]].colour, Vec4f(1, 1, 1, 0.5F));
  EXPECT_EQ(appearance.colours[0][0], light(0, 1, 0));
  EXPECT_NE(appearance.materials[appearance.material[1]].texture, SurfaceMaterial::no_texture);
  EXPECT_EQ(appearance.colours[1][0], Vec4f(1));
  EXPECT_EQ(appearance.materials[appearance.material[2]].texture, SurfaceMaterial::no_texture);
  EXPECT_EQ(appearance.colours[2][0], light(0, 1, 0));
  EXPECT_THAT(warnings_, ElementsAre(HasSubstr("1 triangles have a texture but no texture "
                                               "coordinates; their colour is that of their "
                                               "vertices or Kd")));
}

TEST_F(ObjColoursTest, RefusesTexturesThatItCannotRead) {
  const std::string obj = "mtllib part.mtl\n" + triangle + corners + "usemtl a\nf 1/1 2/2 3/3\n";
  writeLibrary("newmtl a\nmap_Kd none.png\n");
  EXPECT_THAT(refused(obj), HasSubstr("texture 'none.png': no such file in the folder of the mesh; "
                                      "put it there"));
  EXPECT_EQ(refusal(obj, name()), "read");
  writeLibrary("newmtl a\nmap_Kd ../tex2.png\n");
  EXPECT_THAT(refused(obj), HasSubstr("texture '../tex2.png' lies outside of the folder"));
  scratch_.write("broken.png", "\x89PNG\r\n\x1A\n");
  writeLibrary("newmtl a\nmap_Kd broken.png\n");
  EXPECT_THAT(refused(obj),
              HasSubstr("texture 'broken.png' is not a readable PNG: it is cut short"));
  writeLibrary("newmtl a\nmap_Kd a\x01\x1B.png\n");
  EXPECT_THAT(refused(obj), HasSubstr("texture 'a??.png': the name contains the unprintable"));
  // A material that no triangle has may name anything.
  writeLibrary("newmtl a\nKd 1 0 0\nnewmtl b\nmap_Kd none.png\n");
  EXPECT_EQ(refused(obj), "read");
}

TEST_F(ObjColoursTest, RefusesCoordinatesOutOfRangeOnTextures) {
  writeLibrary("newmtl a\nmap_Kd tex.png\n");
  for (const char* corner : {"4", "0", "-4", "99999999999999999999", "4294967295"}) {
    const std::string face = "f 1/1 2/2 3/" + std::string(corner) + "\n";
    EXPECT_THAT(refused("mtllib part.mtl\n" + triangle + corners + "usemtl a\n" + face),
                HasSubstr("a face with the texture 'tex.png' has texture coordinates that are out "
                          "of range: the file has 3; export it again"))
        << corner;
    EXPECT_EQ(refused(triangle + corners + face), "read");
  }
  EXPECT_THAT(refused(triangle + "vt 0 nan\nf 1 2 3\n"),
              HasSubstr("line 4: texture coordinates are not finite; export it again"));
}

TEST_F(ObjColoursTest, DamageIsReadOrRefused) {
  const std::string obj = "mtllib part.mtl\n" + triangle + corners +
                          "usemtl a\nf 1/1 2/2 3/3\no b\nusemtl b\nf 1/-1 -1/-2 2/2\n";
  const std::string library =
      "newmtl a\nKd 0.5 0.25 1\nmap_Kd -s 2 3 -clamp on tex.png\nnewmtl b\nd 0.5\n";
  writeLibrary(library);
  for (std::size_t size = 0; size < library.size(); ++size) {
    writeLibrary(library.substr(0, size));
    EXPECT_EQ(refused(obj).find('\n'), std::string::npos);
  }
  std::uint32_t state = 7;
  const auto random = [&] { return (state = state * 1664525 + 1013904223) >> 8; };
  for (int round = 0; round < 300; ++round) {
    std::string spoilt = library;
    for (int i = 0; i < 3; ++i) spoilt[random() % spoilt.size()] = static_cast<char>(random());
    writeLibrary(spoilt);
    EXPECT_EQ(refused(obj).find('\n'), std::string::npos) << spoilt;
  }
}

std::vector<std::pair<std::string, std::uint32_t>> partsIn(const Mesh& mesh) {
  std::vector<std::pair<std::string, std::uint32_t>> parts;
  parts.reserve(mesh.parts.size());
  for (const MeshPart& part : mesh.parts) parts.emplace_back(part.name, part.begin);
  return parts;
}

TEST(ObjParts, AreObjectsOrElseGroups) {
  using testing::Pair;
  EXPECT_THAT(partsIn(parse(triangle + "o wheel\nf 1 2 3\nf 1 2 3\no my axle\nf 1 2 3\n")),
              ElementsAre(Pair("wheel", 0), Pair("my axle", 2)));
  EXPECT_THAT(partsIn(parse(triangle + "f 1 2 3\ng wheel left\nf 1 2 3\ng\ng axle\nf 1 2 3\n")),
              ElementsAre(Pair("default", 0), Pair("wheel left", 1), Pair("axle", 2)));
  EXPECT_THAT(partsIn(parse(triangle + "o a\ng x\nf 1 2 3\no b\ng y\nf 1 2 3\ng z\nf 1 2 3\n")),
              ElementsAre(Pair("a", 0), Pair("b", 1)));
  EXPECT_THAT(partsIn(parse("o a\nf 1 2 3\no b\nf 1 2 3\n" + triangle)),
              ElementsAre(Pair("a", 0), Pair("b", 1)));
}

TEST(ObjParts, AreLeftOutWhereNamesInterleaveOrAreOne) {
  EXPECT_THAT(parse(triangle + "g a\nf 1 2 3\ng b\nf 1 2 3\ng a\nf 1 2 3\n").parts, IsEmpty());
  EXPECT_THAT(parse(triangle + "g a\nf 1 2 3\nf 1 2 3\n").parts, IsEmpty());
  // Faces of two corners make no triangle, so that b has none.
  EXPECT_THAT(parse(triangle + "g a\nf 1 2 3\ng b\nf 1 2\ng a\nf 1 2 3\ng c\nf 1 2\n").parts,
              IsEmpty());
}

}  // namespace
}  // namespace vdbdither::test
