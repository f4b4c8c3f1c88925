#include "tests/support/parsed_meshes.h"

#include <cmath>
#include <cstdint>
#include <map>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "io/mesh/mesh_reader.h"
#include "tests/support/shapes.h"
#include "vdbdither/model/errors.h"

namespace vdbdither::test {

namespace {

Mesh parseAs(MeshColours colours, const std::string& bytes, Warnings* warnings,
             const std::string& name) {
  const auto note = [&](const std::string& warning) {
    if (warnings != nullptr) warnings->push_back(warning);
  };
  return parseMesh(MeshFile(name, bytes, note, colours));
}

}  // namespace

Mesh parse(const std::string& bytes, Warnings* warnings, const std::string& name) {
  return parseAs(MeshColours::skip, bytes, warnings, name);
}

Mesh parseWithColours(const std::string& bytes, Warnings* warnings, const std::string& name) {
  Mesh mesh = parseAs(MeshColours::read, bytes, warnings, name);
  expectSoundAppearance(mesh);
  return mesh;
}

Mesh parseQuietly(const std::string& bytes) {
  Warnings warnings;
  Mesh mesh = parse(bytes, &warnings);
  EXPECT_THAT(warnings, testing::IsEmpty());
  return mesh;
}

namespace {

template <class Parse>
std::string refusalOf(const Parse& run) {
  try {
    run();
  } catch (const DataError& error) {
    return error.what();
  }
  return "read";
}

}  // namespace

std::string refusal(const std::string& bytes, const std::string& name) {
  return refusalOf([&] { parse(bytes, nullptr, name); });
}

std::string refusalWithColours(const std::string& bytes, const std::string& name) {
  return refusalOf([&] { parseWithColours(bytes, nullptr, name); });
}

void expectSoundAppearance(const Mesh& mesh) {
  if (mesh.appearance == nullptr) return;
  const Appearance& appearance = *mesh.appearance;
  const std::size_t triangles = mesh.triangles.size();
  EXPECT_EQ(appearance.material.size(), triangles);
  EXPECT_TRUE(appearance.coordinates.empty() || appearance.coordinates.size() == triangles);
  EXPECT_TRUE(appearance.colours.empty() || appearance.colours.size() == triangles);
  const auto isShare = [](float value) { return value >= 0 && value <= 1; };
  bool are_sound = true;
  for (const std::uint32_t material : appearance.material)
    are_sound = are_sound && material < appearance.materials.size();
  for (const SurfaceMaterial& material : appearance.materials) {
    for (int i = 0; i < 4; ++i) are_sound = are_sound && isShare(material.colour[i]);
    are_sound = are_sound && (material.texture == SurfaceMaterial::no_texture ||
                              material.texture < appearance.textures.size());
  }
  for (const Appearance::Colours& corners : appearance.colours) {
    for (const openvdb::Vec4f& colour : corners) {
      for (int i = 0; i < 4; ++i) are_sound = are_sound && isShare(colour[i]);
    }
  }
  for (const Appearance::Coordinates& corners : appearance.coordinates) {
    for (const openvdb::Vec2f& corner : corners)
      are_sound = are_sound && std::isfinite(corner.x()) && std::isfinite(corner.y());
  }
  EXPECT_TRUE(are_sound);
}

void expectSame(const Mesh& mesh, const Mesh& expected) {
  EXPECT_EQ(mesh.vertices, expected.vertices);
  EXPECT_EQ(mesh.triangles, expected.triangles);
}

Mesh floatPart() {
  const Mesh mesh =
      transformed(sphereMesh({1.0, -2.0, 3.0}, 4.0, 5), {10, 20, 30}, {0.1, 0.2, 0.3});
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

void expectEveryPrefixIsReadOrRefused(const std::string& bytes, bool knows_its_end) {
  const std::size_t triangles = parse(bytes).triangles.size();
  for (std::size_t size = 0; size < bytes.size(); ++size) {
    const std::string message = refusal(bytes.substr(0, size));
    EXPECT_EQ(message.find('\n'), std::string::npos);
    EXPECT_EQ(refusalWithColours(bytes.substr(0, size)).find('\n'), std::string::npos);
    if (!knows_its_end || message != "read") continue;
    Warnings warnings;
    const std::size_t read = parse(bytes.substr(0, size), &warnings).triangles.size();
    EXPECT_TRUE(read == triangles || !warnings.empty()) << size;
  }
}

void expectSpoiltBytesAreReadOrRefused(const std::string& bytes) {
  std::mt19937 random(7);
  for (int round = 0; round < 2000; ++round) {
    std::string spoilt = bytes;
    for (int flips = 1 + static_cast<int>(random() % 4); flips > 0; --flips) {
      spoilt[random() % spoilt.size()] = static_cast<char>(random());
    }
    try {
      const Mesh mesh = parse(spoilt);
      for (const openvdb::Vec3d& vertex : mesh.vertices) ASSERT_TRUE(isFinite(vertex));
      for (const Mesh::Triangle& triangle : mesh.triangles) {
        for (const std::uint32_t vertex : triangle) ASSERT_LT(vertex, mesh.vertices.size());
      }
      expectSame(parseWithColours(spoilt), mesh);
    } catch (const DataError& error) {
      ASSERT_EQ(std::string(error.what()).find('\n'), std::string::npos);
    }
  }
}

}  // namespace vdbdither::test
