#include "ops/kernels/mesh/mesh_parts.h"

#include <cstdint>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "ops/kernels/mesh/mesh_placement.h"
#include "tests/support/shapes.h"

namespace vdbdither {
namespace {

using test::boxMesh;
using test::unshared;
using testing::SizeIs;

const Mesh left = boxMesh({0, 0, 0}, {1, 1, 1});
const Mesh right = boxMesh({5, 0, 0}, {6, 1, 1});

Mesh named(const std::vector<MeshPart>& parts) {
  Mesh mesh = joined({left, right});
  mesh.parts = parts;
  return mesh;
}

TEST(MeshParts, ClosedPartsAreMeshesOfTheirOwn) {
  const std::vector<Mesh> parts = partsOf(named({{"left", 0}, {"right", 12}}));
  ASSERT_THAT(parts, SizeIs(2));
  EXPECT_THAT(parts[0].vertices, testing::UnorderedElementsAreArray(left.vertices));
  EXPECT_THAT(parts[1].vertices, testing::UnorderedElementsAreArray(right.vertices));
  for (const Mesh& part : parts) {
    EXPECT_THAT(part.triangles, SizeIs(12));
    EXPECT_THAT(part.parts, SizeIs(0));
  }
  for (std::size_t corner = 0; corner < 3; ++corner)
    EXPECT_EQ(parts[1].vertices[parts[1].triangles[4][corner]],
              right.vertices[right.triangles[4][corner]]);
}

/// As files have meshes that state normals or places on textures.
Mesh split(const Mesh& mesh) {
  Mesh result = unshared(mesh);
  result.parts = mesh.parts;
  return result;
}

TEST(MeshParts, AreClosedWhereTheirVerticesStandSeveralTimes) {
  Mesh mesh = split(named({{"left", 0}, {"right", 12}}));
  // Zeros of both signs are one place, and a triangle without an area is no side.
  for (std::size_t i = 0; i < mesh.vertices.size(); i += 2) {
    if (mesh.vertices[i].x() == 0) mesh.vertices[i].x() = -0.0;
  }
  mesh.vertices.push_back(right.vertices[0]);
  mesh.triangles.push_back({36, 36, static_cast<std::uint32_t>(mesh.vertices.size() - 1)});
  const std::vector<Mesh> parts = partsOf(mesh);
  ASSERT_THAT(parts, SizeIs(2));
  EXPECT_THAT(parts[0].vertices, SizeIs(36));
  EXPECT_THAT(parts[1].triangles, SizeIs(13));
  EXPECT_THAT(partsOf(split(named({{"left", 0}, {"right", 11}}))), SizeIs(1));
}

TEST(MeshParts, PatchesAndRepeatedNamesAreOneMesh) {
  for (const Mesh& mesh :
       {named({}), named({{"left", 0}, {"right", 11}}), named({{"a", 0}, {"b", 2}, {"c", 12}}),
        named({{"a", 0}, {"b", 12}, {"a", 24}})}) {
    const std::vector<Mesh> parts = partsOf(mesh);
    ASSERT_THAT(parts, SizeIs(1));
    EXPECT_EQ(parts[0].vertices, mesh.vertices);
    EXPECT_EQ(parts[0].triangles, mesh.triangles);
    EXPECT_THAT(parts[0].parts, SizeIs(0));
  }
}

}  // namespace
}  // namespace vdbdither
