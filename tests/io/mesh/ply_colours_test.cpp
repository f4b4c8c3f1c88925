#include <bit>

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

Vec4f light(double red, double green, double blue, double opacity = 1) {
  return {static_cast<float>(linearOfSrgb(red)), static_cast<float>(linearOfSrgb(green)),
          static_cast<float>(linearOfSrgb(blue)), static_cast<float>(opacity)};
}

std::string vertexHeader(int count, const std::string& properties = "") {
  return "element vertex " + std::to_string(count) +
         "\nproperty float x\nproperty float y\nproperty float z\n" + properties;
}

std::string faceHeader(int count, const std::string& properties = "") {
  return "element face " + std::to_string(count) + "\nproperty list uchar int vertex_indices\n" +
         properties;
}

const std::string ascii = "ply\nformat ascii 1.0\n";

std::string scalars(const std::string& type, std::initializer_list<const char*> names) {
  std::string text;
  for (const char* name : names) text += "property " + type + " " + name + "\n";
  return text;
}

TEST(PlyColours, ReadsColoursOfVertices) {
  for (const auto& [names, has_opacity] : std::vector<std::pair<std::array<const char*, 4>, bool>>{
           {{"red", "green", "blue", "alpha"}, true},
           {{"r", "g", "b", "a"}, true},
           {{"Red", "Green", "Blue", "Alpha"}, true},
           {{"diffuse_red", "diffuse_green", "diffuse_blue", ""}, false}}) {
    std::string properties = scalars("uchar", {names[0], names[1], names[2]});
    if (has_opacity) properties += scalars("uchar", {names[3]});
    const std::string opacity = has_opacity ? " 51" : "";
    Warnings warnings;
    const Mesh mesh = parseWithColours(
        ascii + vertexHeader(3, properties) + faceHeader(1) + "end_header\n0 0 0 255 0 128" +
            opacity + "\n1 0 0 0 51 0" + opacity + "\n0 1 0 1 2 3" + opacity + "\n3 0 1 2\n",
        &warnings);
    EXPECT_THAT(warnings, IsEmpty());
    ASSERT_NE(mesh.appearance, nullptr) << names[0];
    const double share = has_opacity ? 0.2 : 1;
    EXPECT_THAT(mesh.appearance->colours.at(0),
                ElementsAre(light(1, 0, 128 / 255.0, share), light(0, 0.2, 0, share),
                            light(1 / 255.0, 2 / 255.0, 3 / 255.0, share)));
  }
}

/// A binary file of one coloured triangle; `colour` are the bytes of every vertex's colour.
std::string binary(const std::string& encoding, const std::string& type,
                   const std::string& colour) {
  std::string bytes = "ply\nformat binary_" + encoding + "_endian 1.0\n" +
                      vertexHeader(3, scalars(type, {"red", "green", "blue"})) + faceHeader(1) +
                      "end_header\n";
  for (const float coordinate : {0.0F, 1.0F, 2.0F}) {
    for (int axis = 0; axis < 3; ++axis) {
      auto bits = std::bit_cast<std::uint32_t>(axis == static_cast<int>(coordinate) ? 1.0F : 0.0F);
      for (int byte = 0; byte < 4; ++byte)
        bytes += static_cast<char>(bits >> (encoding == "big" ? 24 - 8 * byte : 8 * byte));
    }
    bytes += colour;
  }
  bytes += '\3';
  for (int corner = 0; corner < 3; ++corner) {
    for (int byte = 0; byte < 4; ++byte)
      bytes += static_cast<char>(byte == (encoding == "big" ? 3 : 0) ? corner : 0);
  }
  return bytes;
}

TEST(PlyColours, ReadsEveryTypeOfNumber) {
  using namespace std::string_literals;
  const auto first = [](const std::string& bytes) {
    const Mesh mesh = parseWithColours(bytes);
    return mesh.appearance ? mesh.appearance->colours.at(0)[0] : Vec4f(-1);
  };
  const Vec4f expected = light(1, 0, 0.2);
  EXPECT_EQ(first(binary("little", "uchar", "\xFF\0\x33"s)), expected);
  EXPECT_EQ(first(binary("little", "ushort", "\xFF\xFF\0\0\x33\x33"s)), expected);
  EXPECT_EQ(first(binary("big", "ushort", "\xFF\xFF\0\0\x33\x33"s)), expected);
  EXPECT_EQ(first(binary("little", "float", "\0\0\x80\x3F\0\0\0\0\0\0\0\x3F"s)), light(1, 0, 0.5));
  EXPECT_EQ(
      first(binary("big", "double", "\x3F\xF0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\x3F\xE0\0\0\0\0\0\0"s)),
      light(1, 0, 0.5));
}

TEST(PlyColours, TheGreatestValueDecidesWhatIntegersMean) {
  const auto first = [](const std::string& type, const std::string& colour, Warnings& warnings) {
    warnings.clear();
    const Mesh mesh =
        parseWithColours(ascii + vertexHeader(3, scalars(type, {"red", "green", "blue", "alpha"})) +
                             faceHeader(1) + "end_header\n0 0 0 " + colour + "\n1 0 0 " + colour +
                             "\n0 1 0 " + colour + "\n3 0 1 2\n",
                         &warnings);
    return mesh.appearance->colours.at(0)[0];
  };
  Warnings warnings;
  for (const char* type : {"short", "ushort"}) {
    EXPECT_EQ(first(type, "255 0 51 102", warnings), light(1, 0, 0.2, 0.4)) << type;
    EXPECT_THAT(warnings, ElementsAre("'part': colours of vertices do not go beyond 255; they are "
                                      "read as 0 to 255"));
  }
  for (const char* type : {"int", "uint"}) {
    EXPECT_EQ(first(type, "65535 0 13107 26214", warnings), light(1, 0, 0.2, 0.4)) << type;
    EXPECT_THAT(warnings, ElementsAre("'part': colours of vertices go beyond 255; they are read as "
                                      "0 to 65535"));
    EXPECT_EQ(first(type, "255 0 51 102", warnings), light(1, 0, 0.2, 0.4)) << type;
    EXPECT_THAT(warnings, IsEmpty());
  }
  EXPECT_EQ(first("ushort", "0 0 0 65535", warnings), light(0, 0, 0));
  EXPECT_THAT(warnings, IsEmpty());
}

TEST(PlyColours, TakesRealsBeyondOneAsBytes) {
  Warnings warnings;
  const Mesh mesh = parseWithColours(
      ascii + vertexHeader(3, scalars("float", {"red", "green", "blue"})) + faceHeader(1) +
          "end_header\n0 0 0 255 0 51\n1 0 0 nan -3 inf\n0 1 0 0 0 0\n3 0 1 2\n",
      &warnings);
  EXPECT_THAT(warnings,
              ElementsAre("'part': colours of vertices go beyond 1; they are read as 0 to 255"));
  EXPECT_EQ(mesh.appearance->colours.at(0)[0], light(1, 0, 0.2));
  EXPECT_EQ(mesh.appearance->colours.at(0)[1], light(0, 0, 1));
}

TEST(PlyColours, ReadsColoursOfFaces) {
  const std::string vertices = "0 0 0\n1 0 0\n1 1 0\n0 1 0\n";
  const Mesh mesh = parseWithColours(
      ascii + vertexHeader(4) + faceHeader(2, scalars("uchar", {"red", "green", "blue"})) +
      "end_header\n" + vertices + "4 0 1 2 3 255 0 0\n3 0 1 2 0 255 0\n");
  EXPECT_THAT(mesh.appearance->colours,
              ElementsAre(testing::Each(light(1, 0, 0)), testing::Each(light(1, 0, 0)),
                          testing::Each(light(0, 1, 0))));
  const Mesh both = parseWithColours(
      ascii + vertexHeader(3, scalars("uchar", {"red", "green", "blue"})) +
      faceHeader(1, scalars("uchar", {"red", "green", "blue"})) +
      "end_header\n0 0 0 0 0 255\n1 0 0 0 0 255\n0 1 0 0 0 255\n3 0 1 2 255 0 0\n");
  EXPECT_THAT(both.appearance->colours, ElementsAre(testing::Each(light(0, 0, 1))));
}

TEST(PlyColours, ColoursFollowFacesBeforeTheirVerticesAndStrips) {
  const std::string colours = scalars("uchar", {"red", "green", "blue"});
  const std::string vertices = "0 0 0 255 0 0\n1 0 0 0 255 0\n0 1 0 0 0 255\n1 1 0 255 255 255\n";
  const Mesh early = parseWithColours(ascii + faceHeader(1) + vertexHeader(4, colours) +
                                      "end_header\n3 2 1 0\n" + vertices);
  EXPECT_THAT(early.appearance->colours.at(0),
              ElementsAre(light(0, 0, 1), light(0, 1, 0), light(1, 0, 0)));
  const Mesh strips = parseWithColours(ascii + vertexHeader(4, colours) +
                                       "element tristrips 1\nproperty list int int vertex_indices\n"
                                       "end_header\n" +
                                       vertices + "4 0 1 2 3\n");
  EXPECT_THAT(strips.appearance->colours.at(1),
              ElementsAre(light(0, 0, 1), light(0, 1, 0), light(1, 1, 1)));
}

/// Files in a folder of their own.
class PlyTextures : public testing::Test {
 protected:
  PlyTextures() {
    scratch_.write("a b.png", textOf(pngOf(pattern(4, 2, 3))));
    scratch_.write("c.png", textOf(pngOf(pattern(3, 5, 3))));
  }
  Mesh read(const std::string& bytes) { return parseWithColours(bytes, &warnings_, name()); }
  [[nodiscard]] std::string name() const { return (scratch_ / "part.ply").string(); }

  ScratchFolder scratch_;
  Warnings warnings_;
};

const std::string textured = ascii + "comment TextureFile a b.png \ncomment texturefile c.png\n";
const std::string square = "0 0 0\n1 0 0\n1 1 0\n0 1 0\n";

TEST_F(PlyTextures, ReadsCoordinatesOfCorners) {
  const Mesh mesh =
      read(textured + vertexHeader(4) +
           faceHeader(3, "property list uchar float texcoord\nproperty int texnumber\n") +
           "end_header\n" + square +
           "4 0 1 2 3 8 0 0 1 0 1 1 0 1 1\n3 0 1 2 6 0 0 .5 0 .5 .25 0\n3 0 1 2 0 -1\n");
  const Appearance& appearance = *mesh.appearance;
  ASSERT_EQ(appearance.textures.size(), 2U);
  EXPECT_THAT(appearance.coordinates[0], ElementsAre(Vec2f(0, 1), Vec2f(1, 1), Vec2f(1, 0)));
  EXPECT_THAT(appearance.coordinates[1], ElementsAre(Vec2f(0, 1), Vec2f(1, 0), Vec2f(0, 0)));
  EXPECT_THAT(appearance.coordinates[2],
              ElementsAre(Vec2f(0, 1), Vec2f(0.5F, 1), Vec2f(0.5F, 0.75F)));
  const auto textureOf = [&](std::size_t triangle) -> const Texture& {
    return appearance.textures.at(
        appearance.materials.at(appearance.material.at(triangle)).texture);
  };
  EXPECT_EQ(textureOf(0).height, 5U);
  EXPECT_EQ(textureOf(2).height, 2U);
  EXPECT_EQ(appearance.materials.at(appearance.material.at(3)).texture,
            SurfaceMaterial::no_texture);
  EXPECT_THAT(warnings_, ElementsAre(HasSubstr("1 triangles have no texture coordinates, or a "
                                               "texture that the header does not name; they are "
                                               "not textured")));
}

TEST_F(PlyTextures, ReadsCoordinatesOfVertices) {
  for (const auto& [u, v] : std::vector<std::pair<const char*, const char*>>{
           {"s", "t"}, {"u", "v"}, {"texture_u", "texture_v"}, {"texcoord_u", "texcoord_v"}}) {
    const Mesh mesh = read(textured + vertexHeader(3, scalars("float", {u, v})) + faceHeader(1) +
                           "end_header\n0 0 0 0 0\n1 0 0 1 0\n0 1 0 0 .25\n3 2 0 1\n");
    EXPECT_THAT(mesh.appearance->coordinates.at(0),
                ElementsAre(Vec2f(0, 0.75F), Vec2f(0, 1), Vec2f(1, 1)));
    EXPECT_EQ(mesh.appearance->textures.at(0).height, 2U);
  }
  EXPECT_THAT(warnings_, IsEmpty());
}

TEST_F(PlyTextures, CoordinatesAreKeptForATextureThatTheUserGives) {
  const std::string coloured =
      vertexHeader(3, scalars("float", {"s", "t"}) + scalars("uchar", {"red", "green", "blue"}));
  const Mesh of_vertices =
      read(ascii + coloured + faceHeader(1) +
           "end_header\n0 0 0 0 0 255 0 0\n1 0 0 1 0 255 0 0\n0 1 0 0 .25 255 0 0\n3 2 0 1\n");
  EXPECT_THAT(of_vertices.appearance->coordinates.at(0),
              ElementsAre(Vec2f(0, 0.75F), Vec2f(0, 1), Vec2f(1, 1)));
  EXPECT_EQ(of_vertices.appearance->colours.at(0)[0], light(1, 0, 0));
  const Mesh of_corners =
      read(ascii + vertexHeader(3) + faceHeader(1, "property list uchar float texcoord\n") +
           "end_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2 6 0 0 1 0 0 1\n");
  EXPECT_THAT(of_corners.appearance->coordinates.at(0),
              ElementsAre(Vec2f(0, 1), Vec2f(1, 1), Vec2f(0, 0)));
  EXPECT_FALSE(of_corners.appearance->hasColours());
  EXPECT_THAT(warnings_, IsEmpty());
}

TEST_F(PlyTextures, CountMoreThanColoursOfVertices) {
  const Mesh mesh =
      read(textured + vertexHeader(3, scalars("uchar", {"red", "green", "blue"})) +
           faceHeader(1, "property list uchar float texcoord\n") +
           "end_header\n0 0 0 9 9 9\n1 0 0 9 9 9\n0 1 0 9 9 9\n3 0 1 2 6 0 0 1 0 0 1\n");
  EXPECT_EQ(mesh.appearance->materials.at(mesh.appearance->material.at(0)).texture, 0U);
  EXPECT_THAT(mesh.appearance->colours, IsEmpty());
}

TEST_F(PlyTextures, AreRefusedWhereTheyAreMissingAndToldWithoutCoordinates) {
  const std::string body = vertexHeader(3, scalars("float", {"s", "t"})) + faceHeader(1) +
                           "end_header\n0 0 0 0 0\n1 0 0 1 0\n0 1 0 0 .25\n3 0 1 2\n";
  const std::string missing = ascii + "comment TextureFile none.png\n" + body;
  EXPECT_THAT(
      refusalWithColours(missing, name()),
      HasSubstr("texture 'none.png': no such file in the folder of the mesh; put it there"));
  EXPECT_EQ(refusal(missing, name()), "read");
  EXPECT_EQ(read(textured + vertexHeader(3) + faceHeader(1) +
                 "end_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n")
                .appearance,
            nullptr);
  EXPECT_THAT(warnings_, ElementsAre(HasSubstr("names a texture, but has no texture coordinates; "
                                               "the texture is not read")));
}

TEST_F(PlyTextures, DamageIsReadOrRefused) {
  const std::string bytes =
      textured + vertexHeader(4, scalars("uchar", {"red", "green", "blue"})) +
      faceHeader(2, "property list uchar float texcoord\nproperty int texnumber\n") +
      "end_header\n0 0 0 1 2 3\n1 0 0 1 2 3\n1 1 0 1 2 3\n0 1 0 1 2 3\n"
      "4 0 1 2 3 8 0 0 1 0 1 1 0 1 1\n3 0 1 2 6 0 0 .5 0 .5 .25 0\n";
  std::uint32_t state = 7;
  const auto random = [&] { return (state = state * 1664525 + 1013904223) >> 8; };
  for (int round = 0; round < 500; ++round) {
    std::string spoilt = bytes;
    for (int i = 0; i < 2; ++i) spoilt[random() % spoilt.size()] = static_cast<char>(random());
    EXPECT_EQ(refusalWithColours(spoilt, name()).find('\n'), std::string::npos) << spoilt;
  }
}

}  // namespace
}  // namespace vdbdither::test
