#include "ops/kernels/mesh/mesh_bodies.h"

#include <algorithm>
#include <map>
#include <utility>

#include <gtest/gtest.h>

#include "ops/kernels/mesh/mesh_placement.h"
#include "ops/kernels/mesh/mesh_repair.h"
#include "tests/support/shapes.h"

namespace vdbdither {
namespace {

using openvdb::Vec3d;
using test::boxMesh;
using test::sphereMesh;

/// The body of each triangle.
std::vector<std::uint32_t> bodiesOf(const Mesh& mesh) {
  const MeshEdges edges(mesh);
  const MeshBodies bodies(mesh, edges);
  std::vector<std::uint32_t> of;
  for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t) of.push_back(bodies.of(t));
  return of;
}

std::vector<int> lowestOf(const Mesh& mesh, const std::vector<char>& crosses_itself) {
  const MeshEdges edges(mesh);
  return MeshBodies(mesh, edges).lowestNumbers(mesh, edges, crosses_itself);
}

/// Returns the parts as one mesh whose corners at one place are one vertex.
Mesh welded(std::vector<Mesh> parts) {
  const Mesh apart = joined(std::move(parts));
  Mesh mesh;
  std::map<Vec3d, std::uint32_t> places;
  for (const Mesh::Triangle& triangle : apart.triangles) {
    Mesh::Triangle& own = mesh.triangles.emplace_back();
    for (std::size_t corner = 0; corner < 3; ++corner) {
      const Vec3d& p = apart.vertices[triangle[corner]];
      const auto [place, is_new] =
          places.emplace(p, static_cast<std::uint32_t>(mesh.vertices.size()));
      if (is_new) mesh.vertices.push_back(p);
      own[corner] = place->second;
    }
  }
  return mesh;
}

TEST(MeshBodies, BoxesThatShareAnEdgeStayApart) {
  const Mesh mesh = welded({boxMesh({0, 0, 0}, {1, 1, 1}), boxMesh({1, 1, 0}, {2, 2, 1})});
  ASSERT_EQ(mesh.vertices.size(), 14U);
  std::vector<std::uint32_t> expected(24, 0);
  std::fill(expected.begin() + 12, expected.end(), 1U);
  EXPECT_EQ(bodiesOf(mesh), expected);
  EXPECT_EQ(lowestOf(mesh, {0, 0}), (std::vector<int>{0, 0}));
}

TEST(MeshBodies, WhatIsClosedOnlyTogetherIsOne) {
  // Between the boxes lie two walls that face the same way, and no edge of theirs is one of two.
  //
  //    number    0 |   1   ||  -1   | 0
  //    faces     <-+       +>       +>
  const Mesh mesh =
      welded({boxMesh({0, 0, 0}, {1, 1, 1}), test::insideOut(boxMesh({1, 0, 0}, {2, 1, 1}))});
  EXPECT_EQ(bodiesOf(mesh), std::vector<std::uint32_t>(24, 0));
  EXPECT_EQ(lowestOf(mesh, {0}), std::vector<int>{MeshBodies::any_number});
}

TEST(MeshBodies, LowestNumbersFollowTheDirectionOfTheFaces) {
  const Mesh ball = sphereMesh({5, 0, 0}, 1, 4);
  const Mesh mesh = joined({ball, test::insideOut(sphereMesh({9, 0, 0}, 1, 4)), ball});
  EXPECT_EQ(lowestOf(mesh, {0, 0, 1}), (std::vector<int>{0, -1, MeshBodies::any_number}));
}

}  // namespace
}  // namespace vdbdither
