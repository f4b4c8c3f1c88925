#include "tests/support/parsed_meshes.h"

#include <cstdint>
#include <map>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "io/mesh/mesh_reader.h"
#include "tests/support/shapes.h"
#include "vdbdither/model/errors.h"

namespace vdbdither::test {

Mesh parse(const std::string& bytes, Warnings* warnings, const std::string& name) {
  return parseMesh(MeshFile(name, bytes, [&](const std::string& warning) {
    if (warnings != nullptr) warnings->push_back(warning);
  }));
}

Mesh parseQuietly(const std::string& bytes) {
  Warnings warnings;
  Mesh mesh = parse(bytes, &warnings);
  EXPECT_THAT(warnings, testing::IsEmpty());
  return mesh;
}

std::string refusal(const std::string& bytes, const std::string& name) {
  try {
    parse(bytes, nullptr, name);
  } catch (const DataError& error) {
    return error.what();
  }
  return "read";
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
    } catch (const DataError& error) {
      ASSERT_EQ(std::string(error.what()).find('\n'), std::string::npos);
    }
  }
}

}  // namespace vdbdither::test
