#include "ops/kernels/mesh/swallowed_walls.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include <gtest/gtest.h>
#include <openvdb/math/BBox.h>

#include "ops/kernels/distance/mesh_distance.h"
#include "ops/kernels/mesh/mesh_placement.h"
#include "ops/kernels/mesh/mesh_repair.h"
#include "tests/support/shapes.h"

namespace vdbdither {
namespace {

using openvdb::CoordBBox;
using openvdb::Vec3d;
using Box = openvdb::math::BBox<Vec3d>;

Mesh meshOf(const std::vector<Box>& boxes) {
  std::vector<Mesh> parts;
  parts.reserve(boxes.size());
  for (const Box& box : boxes) parts.push_back(test::boxMesh(box.min(), box.max()));
  return joined(std::move(parts));
}

double distanceTo(const Box& box, const Vec3d& p) {
  const Vec3d nearest =
      openvdb::math::maxComponent(box.min(), openvdb::math::minComponent(box.max(), p));
  return (nearest - p).length();
}

/// The signed distance from the union of boxes: to the nearest cell of the other kind, of those
/// that all their faces' planes part space into.
double distanceToUnion(const std::vector<Box>& boxes, const Vec3d& p) {
  std::array<std::vector<double>, 3> cuts;
  for (int axis = 0; axis < 3; ++axis) {
    std::vector<double>& own = cuts[static_cast<std::size_t>(axis)];
    own = {-1e4, 1e4};
    for (const Box& box : boxes) own.insert(own.end(), {box.min()[axis], box.max()[axis]});
    std::sort(own.begin(), own.end());
    own.erase(std::unique(own.begin(), own.end()), own.end());
  }
  const auto holds = [&](const Vec3d& at) {
    return std::any_of(boxes.begin(), boxes.end(),
                       [&](const Box& box) { return box.isInside(at); });
  };
  double to_solid = std::numeric_limits<double>::infinity();
  double to_air = to_solid;
  for (std::size_t i = 0; i + 1 < cuts[0].size(); ++i)
    for (std::size_t j = 0; j + 1 < cuts[1].size(); ++j)
      for (std::size_t k = 0; k + 1 < cuts[2].size(); ++k) {
        const Box cell(Vec3d(cuts[0][i], cuts[1][j], cuts[2][k]),
                       Vec3d(cuts[0][i + 1], cuts[1][j + 1], cuts[2][k + 1]));
        double& nearest = holds(cell.getCenter()) ? to_solid : to_air;
        nearest = std::min(nearest, distanceTo(cell, p));
      }
  return to_solid > 0 ? to_solid : -to_air;
}

const Vec3d pitch_mm(0.042, 0.084, 0.022);

/// Checks every voxel around the boxes, of which `mesh` is made, when all lies `away` from the
/// origin: far inside, near swallowed walls and near the surface.
void expectDistancesToTheUnion(const std::vector<Box>& boxes, const Mesh& mesh,
                               const openvdb::Coord& away) {
  const Lattice lattice{
      pitch_mm, Vec3d(0, 0, 0),
      CoordBBox(openvdb::Coord(-4, -3, -8) + away, openvdb::Coord(34, 18, 64) + away)};
  const DistanceGrids grids =
      MeshDistance(mesh, lattice, Band{0, 0.3}, {}, swallowedWalls(mesh)).run(lattice.layers());
  int inside = 0;
  for (const openvdb::Coord& ijk : lattice.box) {
    const double exact = distanceToUnion(boxes, lattice.position(ijk));
    if (std::abs(exact) < 1e-6 || std::abs(std::abs(exact) - 0.3) < 1e-6) continue;
    inside += exact < 0;
    ASSERT_NEAR(grids.surface->tree().getValue(ijk), std::clamp(exact, -0.3, 0.3), 1e-6) << ijk;
  }
  EXPECT_GT(inside, 1000);
}

/// Near the origin and a metre away; whether the boxes have corners of their own or share those at
/// one position, as they do once repaired.
void expectDistancesToTheUnion(const std::vector<Box>& boxes) {
  for (const openvdb::Coord& away : {openvdb::Coord(0), openvdb::Coord(2400, -9000, 34000)}) {
    std::vector<Box> moved;
    moved.reserve(boxes.size());
    const Vec3d by_mm = away.asVec3d() * pitch_mm;
    for (const Box& box : boxes) moved.emplace_back(box.min() + by_mm, box.max() + by_mm);
    const Mesh mesh = meshOf(moved);
    expectDistancesToTheUnion(moved, mesh, away);
    MeshRepairs repairs;
    expectDistancesToTheUnion(moved, repaired(derived(mesh), repairs).mesh, away);
  }
}

TEST(SwallowedWalls, ACleanMeshHasNone) {
  EXPECT_TRUE(swallowedWalls(test::torusMesh({0, 0, 0}, 1, 0.4, 20)).hidden.empty());
  EXPECT_TRUE(swallowedWalls(test::boxMesh({0, 0, 0}, {1, 2, 3})).hidden.empty());
  EXPECT_TRUE(swallowedWalls(Mesh{}).hidden.empty());
}

TEST(SwallowedWalls, DistancesAreThoseToTheUnionOfOverlappingShells) {
  expectDistancesToTheUnion({Box(Vec3d(0.01, 0.02, 0.03), Vec3d(0.8, 0.9, 0.71)),
                             Box(Vec3d(0.4, 0.33, 0.25), Vec3d(1.2, 1.3, 1.1)),
                             Box(Vec3d(0.1, 0.5, 0.6), Vec3d(0.6, 1.1, 1.2))});
}

TEST(SwallowedWalls, APartWithinAnotherIsNoSurface) {
  const std::vector<Box> boxes{Box(Vec3d(0.01, 0.02, 0.03), Vec3d(1.1, 1.2, 1.1)),
                               Box(Vec3d(0.3, 0.33, 0.25), Vec3d(0.7, 0.8, 0.9))};
  const SwallowedWalls walls = swallowedWalls(meshOf(boxes));
  EXPECT_EQ(walls.swallowed, 12U);
  EXPECT_EQ(walls.cut, 0U);
  expectDistancesToTheUnion(boxes);
}

TEST(SwallowedWalls, TouchingShellsHaveNoMembraneBetweenThem) {
  expectDistancesToTheUnion({Box(Vec3d(0.01, 0.02, 0.03), Vec3d(0.6, 0.9, 0.71)),
                             Box(Vec3d(0.6, 0.3, 0.2), Vec3d(1.2, 1.1, 1.1))});
}

TEST(SwallowedWalls, FacesInOnePlaneStaySurface) {
  expectDistancesToTheUnion({Box(Vec3d(0.01, 0.02, 0.03), Vec3d(0.6, 0.9, 0.71)),
                             Box(Vec3d(0.4, 0.3, 0.03), Vec3d(1.2, 1.1, 0.71))});
}

TEST(SwallowedWalls, ShellsThatShareCornersHaveNoMembraneBetweenThem) {
  expectDistancesToTheUnion({Box(Vec3d(0.02, 0.02, 0.5), Vec3d(0.3, 1.2, 0.9)),
                             Box(Vec3d(0.02, 0.4, 0.1), Vec3d(0.3, 1.2, 0.5)),
                             Box(Vec3d(0.02, 0.02, 0.5), Vec3d(1.2, 1.2, 0.7))});
  // On the lattice, one upon the other.
  expectDistancesToTheUnion({Box(Vec3d(0.042, 0.084, 0.022), Vec3d(0.84, 0.84, 0.44)),
                             Box(Vec3d(0.042, 0.084, 0.44), Vec3d(0.42, 0.42, 0.88)),
                             Box(Vec3d(0.042, 0.42, 0.44), Vec3d(0.84, 0.84, 0.66))});
}

TEST(SwallowedWalls, BoxesOnOneGridHaveNoMembraneBetweenThem) {
  std::mt19937 random(4);
  for (int n = 0; n < 12; ++n) {
    std::vector<Box> boxes;
    for (int box = 0; box < 3; ++box) {
      Vec3d low;
      Vec3d high;
      for (int axis = 0; axis < 3; ++axis) {
        const auto at = static_cast<double>(random() % 3);
        low[axis] = 0.02 + 0.31 * at;
        high[axis] = 0.02 + 0.31 * (at + 1 + static_cast<double>(random() % 2));
      }
      boxes.emplace_back(low, high);
    }
    expectDistancesToTheUnion(boxes);
  }
}

TEST(SwallowedWalls, ACavityIsSurface) {
  Mesh cavity = test::boxMesh({0.3, 0.3, 0.3}, {0.7, 0.7, 0.7});
  for (Mesh::Triangle& t : cavity.triangles) std::swap(t[0], t[1]);
  EXPECT_TRUE(swallowedWalls(joined({test::boxMesh({0, 0, 0}, {1, 1, 1}), cavity})).hidden.empty());
}

}  // namespace
}  // namespace vdbdither
