#include "ops/kernels/mesh/mesh_repair.h"

#include <algorithm>
#include <random>
#include <utility>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "ops/kernels/mesh/mesh_placement.h"
#include "tests/support/mesh_checks.h"
#include "tests/support/shapes.h"

namespace vdbdither {
namespace {

using openvdb::Vec3d;
using test::boxMesh;
using test::insideOut;
using test::openSides;
using test::sphereMesh;
using test::volumeOf;
using testing::ElementsAre;
using testing::IsEmpty;

/// Every triangle with corners of its own, moved by up to `noise_mm`.
Mesh unshared(const Mesh& mesh, double noise_mm) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> noise(-noise_mm, noise_mm);
  Mesh apart = test::unshared(mesh);
  for (Vec3d& v : apart.vertices) v += Vec3d(noise(random), noise(random), noise(random));
  return apart;
}

Mesh repaired(Mesh mesh, MeshRepairs& repairs) {
  return vdbdither::repaired(derived(std::move(mesh)), repairs).mesh;
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
  EXPECT_EQ(openSides(after), 0U);
  EXPECT_THAT(repairs.lines(), IsEmpty());
}

TEST(MeshRepair, WeldsBordersThatAreLessThanAMicrometreApart) {
  MeshRepairs repairs;
  const Mesh after = repaired(unshared(sphereMesh({1, 2, 3}, 1, 8), 2e-4), repairs);
  EXPECT_EQ(openSides(after), 0U);
  EXPECT_GT(repairs.welded_vertices, 0U);
  EXPECT_EQ(repairs.closed_holes, 0U);
  EXPECT_NEAR(volumeOf(after), volumeOf(sphereMesh({1, 2, 3}, 1, 8)), 1e-2);
}

TEST(MeshRepair, TurnsStrayTrianglesToTheMajority) {
  Mesh mesh = sphereMesh({0, 0, 0}, 1, 12);
  const Mesh before = mesh;
  for (std::size_t i = 0; i < mesh.triangles.size(); i += 5)
    std::swap(mesh.triangles[i][0], mesh.triangles[i][1]);
  MeshRepairs repairs;
  const Mesh after = repaired(mesh, repairs);
  EXPECT_EQ(openSides(after), 0U);
  EXPECT_DOUBLE_EQ(volumeOf(after), volumeOf(before));
  EXPECT_EQ(repairs.flipped_triangles, (mesh.triangles.size() + 4) / 5);
}

TEST(MeshRepair, TurnsPartsThatAreInsideOut) {
  const Mesh mesh = joined({sphereMesh({0, 0, 0}, 1, 8), insideOut(sphereMesh({5, 0, 0}, 1, 8))});
  MeshRepairs repairs;
  EXPECT_NEAR(volumeOf(repaired(mesh, repairs)), 2 * volumeOf(sphereMesh({0, 0, 0}, 1, 8)), 1e-9);
  EXPECT_THAT(repairs.lines(), ElementsAre("1 part turned that was inside out"));
}

TEST(MeshRepair, CavitiesStayCavities) {
  const Mesh mesh =
      joined({sphereMesh({0, 0, 0}, 1, 8), insideOut(sphereMesh({0.1, 0, 0}, 0.5, 8))});
  MeshRepairs repairs;
  EXPECT_NEAR(volumeOf(repaired(mesh, repairs)), volumeOf(mesh), 1e-12);
  EXPECT_EQ(repairs.turned_parts, 0U);
}

TEST(MeshRepair, AnIslandInACavityIsTurned) {
  const Mesh hollow =
      joined({sphereMesh({0, 0, 0}, 2, 8), insideOut(sphereMesh({0.1, 0, 0}, 1.5, 8))});
  const Mesh island = sphereMesh({0.2, 0, 0}, 0.5, 4);
  MeshRepairs repairs;
  EXPECT_NEAR(volumeOf(repaired(joined({hollow, insideOut(island)}), repairs)),
              volumeOf(hollow) + volumeOf(island), 1e-12);
  EXPECT_EQ(repairs.turned_parts, 1U);
}

TEST(MeshRepair, PartsThatWereTurnedSurroundTheirCavities) {
  const Mesh shell = sphereMesh({0, 0, 0}, 2, 12);
  const Mesh cavity = sphereMesh({0.3, 0.2, 0}, 1, 8);
  MeshRepairs repairs;
  EXPECT_NEAR(volumeOf(repaired(joined({insideOut(shell), insideOut(cavity)}), repairs)),
              volumeOf(shell) - volumeOf(cavity), 1e-12);
  EXPECT_EQ(repairs.turned_parts, 1U);
}

TEST(MeshRepair, FillsHoles) {
  Mesh mesh = sphereMesh({0, 0, 0}, 1, 12);
  const double whole = volumeOf(mesh);
  mesh.triangles.erase(mesh.triangles.begin() + 30, mesh.triangles.begin() + 34);
  mesh.triangles.pop_back();
  MeshRepairs repairs;
  const Mesh after = repaired(mesh, repairs);
  EXPECT_EQ(openSides(after), 0U);
  EXPECT_GT(repairs.boundary_edges, 3U);
  EXPECT_GT(repairs.closed_holes, 1U);
  EXPECT_NEAR(volumeOf(after), whole, 0.02 * whole);
  EXPECT_EQ(after.triangles.size() - repairs.filling_triangles, mesh.triangles.size());
}

TEST(MeshRepair, AFlatHoleIsFilledFlat) {
  Mesh mesh = boxMesh({0, 0, 0}, {1, 2, 3});
  mesh.triangles.erase(mesh.triangles.begin(), mesh.triangles.begin() + 2);
  MeshRepairs repairs;
  EXPECT_NEAR(volumeOf(repaired(mesh, repairs)), 6, 1e-12);
  EXPECT_THAT(repairs.lines(), ElementsAre("4 boundary edges", "1 hole filled"));
}

TEST(MeshRepair, OfDuplicatesOneStays) {
  Mesh mesh = sphereMesh({0, 0, 0}, 1, 8);
  const double whole = volumeOf(mesh);
  mesh.triangles.push_back(mesh.triangles[7]);
  MeshRepairs repairs;
  EXPECT_DOUBLE_EQ(volumeOf(repaired(mesh, repairs)), whole);
  EXPECT_THAT(repairs.lines(), ElementsAre("1 duplicate triangle dropped"));
}

TEST(MeshRepair, ASurfaceWithTwoSidesBoundsItsInside) {
  const Mesh sphere = sphereMesh({0, 0, 0}, 1, 8);
  const Mesh mesh = joined({sphere, insideOut(sphere)});
  MeshRepairs repairs;
  EXPECT_NEAR(volumeOf(repaired(mesh, repairs)), volumeOf(sphereMesh({0, 0, 0}, 1, 8)), 1e-12);
}

TEST(MeshRepair, AWallBetweenTwoSolidsGoes) {
  Mesh wall = joined({boxMesh({3, 0, 0}, {4, 1, 1}), boxMesh({4, 0, 0}, {5, 1, 1})});
  // Both cut the shared side along the same diagonal.
  for (Mesh::Triangle& t : wall.triangles)
    for (std::uint32_t& v : t)
      if (wall.vertices[v].x() == 4) v = v >= 8 ? v - 7 : v;
  const Mesh mesh = joined({sphereMesh({0, 0, 0}, 1, 8), wall});
  MeshRepairs repairs;
  const Mesh after = repaired(mesh, repairs);
  EXPECT_EQ(openSides(after), 0U);
  EXPECT_NEAR(volumeOf(after), volumeOf(sphereMesh({0, 0, 0}, 1, 8)) + 2, 1e-9);
}

/// A box whose diagonals are those that the bits of `others` tell, one bit for each face.
Mesh boxWithDiagonals(unsigned others) {
  Mesh box = boxMesh({0, 0, 0}, {2, 2, 2});
  for (std::size_t face = 0; face < 6; ++face) {
    if ((others >> face & 1) == 0) continue;
    Mesh::Triangle& first = box.triangles[2 * face];
    Mesh::Triangle& second = box.triangles[2 * face + 1];
    // Turned so that both begin behind the diagonal: (a, b, c) and (d, c, b) become (a, b, d), (a,
    // d, c).
    for (int turn = 0; turn < 3; ++turn) {
      if (std::find(second.begin(), second.end(), first[0]) == second.end()) break;
      std::rotate(first.begin(), first.begin() + 1, first.end());
    }
    for (int turn = 0; turn < 3; ++turn) {
      if (std::find(first.begin(), first.end(), second[0]) == first.end()) break;
      std::rotate(second.begin(), second.begin() + 1, second.end());
    }
    const Mesh::Triangle a = first;
    const std::uint32_t d = second[0];
    first = {a[0], a[1], d};
    second = {a[0], d, a[2]};
  }
  return box;
}

TEST(MeshRepair, ShellsThatShareFacesButNotTheirTrianglesStayClosed) {
  for (unsigned others = 1; others < 64; ++others) {
    Mesh both = boxWithDiagonals(0);
    const Mesh second = boxWithDiagonals(others);
    both.triangles.insert(both.triangles.end(), second.triangles.begin(), second.triangles.end());
    // Tilted, the volumes of flat faces are rounding noise.
    for (Vec3d& v : both.vertices)
      v = {0.8 * v.x() - 0.6 * v.y(), 0.48 * v.x() + 0.64 * v.y() - 0.6 * v.z(),
           0.36 * v.x() + 0.48 * v.y() + 0.8 * v.z()};
    MeshRepairs repairs;
    const Mesh after = repaired(both, repairs);
    EXPECT_EQ(openSides(after), 0U) << others;
    EXPECT_EQ(repairs.turned_parts, 0U) << others;
    EXPECT_EQ(repairs.boundary_edges, 0U) << others;
    EXPECT_EQ(repairs.closed_holes, 0U) << others;
    EXPECT_NEAR(volumeOf(after), 16, 1e-9) << others;
  }
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
  EXPECT_EQ(openSides(repaired(mesh, repairs)), 0U);
  EXPECT_GT(repairs.degenerate_triangles, 0U);
}

TEST(MeshRepair, AnEmptyMeshStaysEmpty) {
  MeshRepairs repairs;
  EXPECT_TRUE(repaired(Mesh{}, repairs).triangles.empty());
}

}  // namespace
}  // namespace vdbdither
