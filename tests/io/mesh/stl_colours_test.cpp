#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "io/image/srgb.h"
#include "tests/support/mesh_files.h"
#include "tests/support/parsed_meshes.h"
#include "tests/support/shapes.h"

namespace vdbdither::test {
namespace {

using openvdb::Vec4f;
using testing::ElementsAre;

Vec4f light(double red, double green, double blue, double opacity = 1) {
  return {static_cast<float>(linearOfSrgb(red)), static_cast<float>(linearOfSrgb(green)),
          static_cast<float>(linearOfSrgb(blue)), static_cast<float>(opacity)};
}

/// A binary STL of a box, its first triangles with these attributes.
std::string coloured(const std::vector<std::uint16_t>& attributes,
                     const std::string& header = "binary STL") {
  std::string bytes = binaryStl(boxMesh({0, 0, 0}, {1, 2, 3}), header);
  for (std::size_t i = 0; i < attributes.size(); ++i) {
    bytes[84 + 50 * i + 48] = static_cast<char>(attributes[i]);
    bytes[84 + 50 * i + 49] = static_cast<char>(attributes[i] >> 8);
  }
  return bytes;
}

/// The colours of the first triangles.
std::vector<Vec4f> coloursOf(const std::string& bytes, std::size_t count) {
  Warnings warnings;
  const Mesh mesh = parseWithColours(bytes, &warnings);
  EXPECT_THAT(warnings, testing::IsEmpty());
  expectSame(mesh, parse(bytes));
  std::vector<Vec4f> colours;
  if (mesh.appearance == nullptr) return colours;
  colours.reserve(count);
  for (std::size_t i = 0; i < count; ++i)
    colours.push_back(mesh.appearance->materials.at(mesh.appearance->material.at(i)).colour);
  return colours;
}

TEST(StlColours, BlueIsLowestWhereTheHeaderHasNoColour) {
  EXPECT_THAT(coloursOf(coloured({0x8000 | 31 << 10, 0x8000 | 31 << 5, 0x8000 | 31,
                                  0x8000 | 3 << 10 | 2 << 5 | 1, 31 << 10}),
                        6),
              ElementsAre(light(1, 0, 0), light(0, 1, 0), light(0, 0, 1),
                          light(3 / 31.0, 2 / 31.0, 1 / 31.0), Vec4f(1), Vec4f(1)));
}

TEST(StlColours, RedIsLowestWhereTheHeaderHasAColour) {
  using namespace std::string_literals;
  const std::string header = "made by COLOR=\xFF\x33\x00\x33,MATERIAL=\xFF\xFF\xFF\xFF"s;
  EXPECT_THAT(coloursOf(coloured({31, 31 << 5, 31 << 10, 0x8000 | 31}, header), 5),
              ElementsAre(light(1, 0, 0), light(0, 1, 0), light(0, 0, 1), light(1, 0.2, 0, 0.2),
                          light(0, 0, 0)));
}

TEST(StlColours, AttributesWithoutTheHighestBitAreNone) {
  EXPECT_THAT(coloursOf(coloured({}), 1), testing::IsEmpty());
  EXPECT_THAT(coloursOf(coloured({31, 1, 0x7FFF}), 1), testing::IsEmpty());
  EXPECT_EQ(parse(coloured({0xFFFF})).appearance, nullptr) << "not asked for";
}

TEST(StlColours, EqualColoursAreOneMaterial) {
  const Mesh mesh = parseWithColours(coloured({0x801F, 0x801F, 0x8000, 0x801F}));
  EXPECT_EQ(mesh.appearance->materials.size(), 3U);
}

TEST(StlColours, EveryFileOfSeveralHasItsOwnHeader) {
  using namespace std::string_literals;
  const std::string bytes = coloured({0x801F}) + coloured({0x801F}, "COLOR=\0\xFF\0\xFF"s);
  const Mesh mesh = parseWithColours(bytes, nullptr, "part.stl");
  ASSERT_NE(mesh.appearance, nullptr);
  const auto colourOf = [&](std::size_t triangle) {
    return mesh.appearance->materials.at(mesh.appearance->material.at(triangle)).colour;
  };
  EXPECT_EQ(colourOf(0), light(0, 0, 1));
  EXPECT_EQ(colourOf(12), light(0, 1, 0));
}

}  // namespace
}  // namespace vdbdither::test
