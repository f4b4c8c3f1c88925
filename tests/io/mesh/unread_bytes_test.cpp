#include "io/mesh/unread_bytes.h"

#include <utility>

#include <gtest/gtest.h>

#include "tests/support/shapes.h"

namespace vdbdither::test {
namespace {

TEST(UnreadBytes, AMeshIsClosedWhereEverySideMeetsAnOpposite) {
  for (const Mesh& closed : {boxMesh({0, 0, 0}, {1, 2, 3}), sphereMesh({1, 2, 3}, 4, 8),
                             unshared(sphereMesh({1, 2, 3}, 4, 8)), Mesh{}}) {
    EXPECT_TRUE(isClosed(closed));
    if (closed.triangles.empty()) continue;
    Mesh open = closed;
    open.triangles.erase(open.triangles.begin() + 3);
    EXPECT_FALSE(isClosed(open));
    Mesh turned = closed;
    std::swap(turned.triangles[3][0], turned.triangles[3][1]);
    EXPECT_FALSE(isClosed(turned));
    Mesh moved = unshared(closed);
    moved.vertices[5].x() += 1e-9;
    EXPECT_FALSE(isClosed(moved));
  }
}

TEST(UnreadBytes, ZerosOfEitherSignAreOnePosition) {
  Mesh mesh = unshared(boxMesh({0, 0, 0}, {1, 1, 1}));
  for (openvdb::Vec3d& vertex : mesh.vertices) {
    if (vertex.x() == 0) vertex.x() = -0.0;
    if (vertex == openvdb::Vec3d(0, 0, 0)) break;
  }
  EXPECT_TRUE(isClosed(mesh));
}

TEST(UnreadBytes, WhiteSpaceAndZerosAreBlank) {
  EXPECT_TRUE(isBlank({}));
  EXPECT_TRUE(isBlank({" \t\r\n\v\f\0\x1A", 8}));
  EXPECT_FALSE(isBlank({" \0a", 3}));
}

}  // namespace
}  // namespace vdbdither::test
