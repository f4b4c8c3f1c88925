#include "ops/kernels/mesh/mesh_parts.h"

#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "ops/kernels/mesh/mesh_placement.h"
#include "tests/support/shapes.h"

namespace vdbdither {
namespace {

using test::boxMesh;
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
