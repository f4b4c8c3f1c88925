#include "ops/kernels/mesh/mesh_repair.h"

#include <cmath>
#include <map>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/shapes.h"

namespace vdbdither {
namespace {

using openvdb::Vec3d;
using test::boxMesh;
using test::sphereMesh;
using testing::ElementsAre;
using testing::IsEmpty;

double volume(const Mesh& mesh) {
  double sum = 0;
  for (const Mesh::Triangle& t : mesh.triangles)
    sum += mesh.vertices[t[0]].dot(mesh.vertices[t[1]].cross(mesh.vertices[t[2]])) / 6;
  return sum;
}

/// Whether every side is met by an opposite one.
bool isCycle(const Mesh& mesh) {
  std::map<std::pair<std::uint32_t, std::uint32_t>, int> surplus;
  for (const Mesh::Triangle& t : mesh.triangles) {
    for (std::size_t side = 0; side < 3; ++side) {
      const std::uint32_t a = t[side];
      const std::uint32_t b = t[(side + 1) % 3];
      if (a != b) surplus[std::minmax(a, b)] += a < b ? 1 : -1;
    }
  }
  return std::all_of(surplus.begin(), surplus.end(),
                     [](const auto& edge) { return edge.second == 0; });
}

void append(Mesh& mesh, const Mesh& more) {
  const auto first = static_cast<std::uint32_t>(mesh.vertices.size());
  mesh.vertices.insert(mesh.vertices.end(), more.vertices.begin(), more.vertices.end());
  for (const Mesh::Triangle& t : more.triangles)
    mesh.triangles.push_back({t[0] + first, t[1] + first, t[2] + first});
}

Mesh insideOut(Mesh mesh) {
  for (Mesh::Triangle& t : mesh.triangles) std::swap(t[1], t[2]);
  return mesh;
}

/// Every triangle with corners of its own, moved by up to `noise_mm`.
Mesh unshared(const Mesh& mesh, double noise_mm) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> noise(-noise_mm, noise_mm);
  Mesh apart;
  for (const Mesh::Triangle& t : mesh.triangles) {
    const auto first = static_cast<std::uint32_t>(apart.vertices.size());
    for (const std::uint32_t v : t)
      apart.vertices.push_back(mesh.vertices[v] +
                               Vec3d(noise(random), noise(random), noise(random)));
    apart.triangles.push_back({first, first + 1, first + 2});
  }
  return apart;
}

TEST(MeshRepair, LeavesAGoodMeshAlone) {
  const Mesh sphere = sphereMesh({1, 2, 3}, 1, 8);
  MeshRepairs repairs;
  const Mesh after = repaired(sphere, repairs);
  EXPECT_EQ(after.triangles, sphere.triangles);
  EXPECT_THAT(repairs.lines(), IsEmpty());
}

TEST(MeshRepair, SharesEqualVerticesWithoutAWord) {
  MeshRepairs repairs;
  const Mesh after = repaired(unshared(sphereMesh({1, 2, 3}, 1, 8), 0), repairs);
  EXPECT_TRUE(isCycle(after));
  EXPECT_THAT(repairs.lines(), IsEmpty());
}

TEST(MeshRepair, WeldsBordersThatAreLessThanAMicrometreApart) {
  MeshRepairs repairs;
  const Mesh after = repaired(unshared(sphereMesh({1, 2, 3}, 1, 8), 2e-4), repairs);
  EXPECT_TRUE(isCycle(after));
  EXPECT_GT(repairs.welded_vertices, 0U);
  EXPECT_EQ(repairs.closed_holes, 0U);
  EXPECT_NEAR(volume(after), volume(sphereMesh({1, 2, 3}, 1, 8)), 1e-2);
}

TEST(MeshRepair, TurnsStrayTrianglesToTheMajority) {
  Mesh mesh = sphereMesh({0, 0, 0}, 1, 12);
  const Mesh before = mesh;
  for (std::size_t i = 0; i < mesh.triangles.size(); i += 5)
    std::swap(mesh.triangles[i][0], mesh.triangles[i][1]);
  MeshRepairs repairs;
  const Mesh after = repaired(mesh, repairs);
  EXPECT_TRUE(isCycle(after));
  EXPECT_DOUBLE_EQ(volume(after), volume(before));
  EXPECT_EQ(repairs.flipped_triangles, (mesh.triangles.size() + 4) / 5);
}

TEST(MeshRepair, TurnsPartsThatAreInsideOut) {
  Mesh mesh = sphereMesh({0, 0, 0}, 1, 8);
  append(mesh, insideOut(sphereMesh({5, 0, 0}, 1, 8)));
  MeshRepairs repairs;
  EXPECT_NEAR(volume(repaired(mesh, repairs)), 2 * volume(sphereMesh({0, 0, 0}, 1, 8)), 1e-9);
  EXPECT_THAT(repairs.lines(), ElementsAre("1 part turned that was inside out"));
}

TEST(MeshRepair, CavitiesStayCavities) {
  Mesh mesh = sphereMesh({0, 0, 0}, 1, 8);
  append(mesh, insideOut(sphereMesh({0.1, 0, 0}, 0.5, 8)));
  MeshRepairs repairs;
  EXPECT_NEAR(volume(repaired(mesh, repairs)), volume(mesh), 1e-12);
  EXPECT_EQ(repairs.turned_parts, 0U);
}

TEST(MeshRepair, FillsHoles) {
  Mesh mesh = sphereMesh({0, 0, 0}, 1, 12);
  const double whole = volume(mesh);
  mesh.triangles.erase(mesh.triangles.begin() + 30, mesh.triangles.begin() + 34);
  mesh.triangles.pop_back();
  MeshRepairs repairs;
  const Mesh after = repaired(mesh, repairs);
  EXPECT_TRUE(isCycle(after));
  EXPECT_GT(repairs.boundary_edges, 3U);
  EXPECT_GT(repairs.closed_holes, 1U);
  EXPECT_NEAR(volume(after), whole, 0.02 * whole);
  EXPECT_EQ(after.triangles.size() - repairs.filling_triangles, mesh.triangles.size());
}

TEST(MeshRepair, AFlatHoleIsFilledFlat) {
  Mesh mesh = boxMesh({0, 0, 0}, {1, 2, 3});
  mesh.triangles.erase(mesh.triangles.begin(), mesh.triangles.begin() + 2);
  MeshRepairs repairs;
  EXPECT_NEAR(volume(repaired(mesh, repairs)), 6, 1e-12);
  EXPECT_THAT(repairs.lines(), ElementsAre("4 boundary edges", "1 hole filled"));
}

TEST(MeshRepair, OfDuplicatesOneStays) {
  Mesh mesh = sphereMesh({0, 0, 0}, 1, 8);
  const double whole = volume(mesh);
  mesh.triangles.push_back(mesh.triangles[7]);
  MeshRepairs repairs;
  EXPECT_DOUBLE_EQ(volume(repaired(mesh, repairs)), whole);
  EXPECT_THAT(repairs.lines(), ElementsAre("1 duplicate triangle dropped"));
}

TEST(MeshRepair, ASurfaceWithTwoSidesBoundsItsInside) {
  Mesh mesh = sphereMesh({0, 0, 0}, 1, 8);
  append(mesh, insideOut(mesh));
  MeshRepairs repairs;
  EXPECT_NEAR(volume(repaired(mesh, repairs)), volume(sphereMesh({0, 0, 0}, 1, 8)), 1e-12);
}

TEST(MeshRepair, AWallBetweenTwoSolidsGoes) {
  Mesh mesh = sphereMesh({0, 0, 0}, 1, 8);
  Mesh wall = boxMesh({3, 0, 0}, {4, 1, 1});
  append(wall, boxMesh({4, 0, 0}, {5, 1, 1}));
  // Both cut the shared side along the same diagonal.
  for (Mesh::Triangle& t : wall.triangles)
    for (std::uint32_t& v : t)
      if (wall.vertices[v].x() == 4) v = v >= 8 ? v - 7 : v;
  append(mesh, wall);
  MeshRepairs repairs;
  const Mesh after = repaired(mesh, repairs);
  EXPECT_TRUE(isCycle(after));
  EXPECT_NEAR(volume(after), volume(sphereMesh({0, 0, 0}, 1, 8)) + 2, 1e-9);
}

TEST(MeshRepair, RandomTrianglesBecomeACycle) {
  std::mt19937 random(11);
  Mesh mesh;
  for (int i = 0; i < 12; ++i)
    mesh.vertices.emplace_back(random() % 100, random() % 100, random() % 100);
  for (int i = 0; i < 60; ++i)
    mesh.triangles.push_back({static_cast<std::uint32_t>(random() % 12),
                              static_cast<std::uint32_t>(random() % 12),
                              static_cast<std::uint32_t>(random() % 12)});
  MeshRepairs repairs;
  EXPECT_TRUE(isCycle(repaired(mesh, repairs)));
  EXPECT_GT(repairs.degenerate_triangles, 0U);
}

TEST(MeshRepair, AnEmptyMeshStaysEmpty) {
  MeshRepairs repairs;
  EXPECT_TRUE(repaired(Mesh{}, repairs).triangles.empty());
}

}  // namespace
}  // namespace vdbdither
