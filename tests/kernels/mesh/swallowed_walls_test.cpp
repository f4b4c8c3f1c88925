#include "ops/kernels/mesh/swallowed_walls.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>

#include <gtest/gtest.h>
#include <openvdb/math/BBox.h>
#include <tbb/global_control.h>

#include "ops/kernels/distance/mesh_distance.h"
#include "ops/kernels/mesh/mesh_placement.h"
#include "ops/kernels/mesh/mesh_repair.h"
#include "ops/kernels/mesh/winding_number.h"
#include "tests/support/interrupted_work.h"
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

/// Whether a place on a triangle is left as surface.
bool isLeft(const SwallowedWalls& walls, std::uint32_t triangle, const Vec3d& p) {
  if (walls.hidden.empty() || !walls.hidden[triangle]) return true;
  for (std::uint32_t piece = 0; piece < walls.piece_of.size(); ++piece) {
    if (walls.piece_of[piece] != triangle) continue;
    const auto at = cornersOf(walls.pieces, piece);
    const Vec3d area = (at[1] - at[0]).cross(at[2] - at[0]);
    bool inside = area.length() > 0;
    for (std::size_t side = 0; side < 3; ++side)
      inside &= area.dot((at[(side + 1) % 3] - at[side]).cross(p - at[side])) >= 0;
    if (inside) return true;
  }
  return false;
}

/// Checks places on every triangle against the winding numbers on both sides. Returns how many are
/// surface.
std::size_t expectWallsWhereOneSideIsSolid(const Mesh& mesh, int places) {
  const SwallowedWalls walls = swallowedWalls(mesh);
  const WindingNumber winding(mesh);
  std::mt19937 random(5);
  std::uniform_real_distribution<double> share(0, 1);
  std::size_t left = 0;
  for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t)
    for (int place = 0; place < places; ++place) {
      const auto [a, b, c] = cornersOf(mesh, t);
      const double one = share(random);
      const double two = share(random) * (1 - one);
      const Vec3d p = a + (b - a) * one + (c - a) * two;
      const Vec3d beside = (b - a).cross(c - a).unit() * 1e-5;
      const auto isSolid = [&](const Vec3d& at) { return std::abs(winding.exactAt(at)) > 0.5; };
      const bool is_surface = isSolid(p + beside) != isSolid(p - beside);
      EXPECT_EQ(isLeft(walls, t, p), is_surface) << t << ' ' << p;
      left += is_surface ? 1 : 0;
    }
  return left;
}

/// Boxes and balls at random places from the origin to `size`.
Mesh heapOf(int count, const Vec3d& size, double height) {
  std::mt19937 random(6);
  std::uniform_real_distribution<double> share(0, 1);
  std::vector<Mesh> parts;
  for (int i = 0; i < count; ++i) {
    const Vec3d at = size * Vec3d(share(random), share(random), share(random));
    const Vec3d extent(0.3 + share(random), 0.3 + share(random), height + share(random));
    parts.push_back(i % 3 == 2 ? test::sphereMesh(at, 0.6, 4) : test::boxMesh(at, at + extent));
  }
  return joined(std::move(parts));
}

TEST(SwallowedWalls, AreWhereBothSidesAreSolid) {
  const std::size_t row = expectWallsWhereOneSideIsSolid(heapOf(30, {14, 0.3, 0.3}, 0.3), 10);
  EXPECT_GT(row, 1000U);
  const std::size_t heap = expectWallsWhereOneSideIsSolid(heapOf(40, {1, 1, 1}, 0.3), 10);
  EXPECT_GT(heap, 200U);
  const std::size_t plane = expectWallsWhereOneSideIsSolid(heapOf(30, {2, 2, 0}, 0.5), 10);
  EXPECT_GT(plane, 200U);
}

TEST(SwallowedWalls, BoxesWithinEachOtherInOnePlaneAreJudgedWithoutTheirOutlines) {
  // Cut along all outlines, these walls would fall into millions of pieces.
  std::mt19937 random(7);
  std::uniform_real_distribution<double> share(0, 1);
  std::vector<Box> boxes;
  for (int i = 0; i < 160; ++i) {
    const Vec3d low(share(random), share(random), 0);
    boxes.emplace_back(low,
                       low + Vec3d(0.5 + share(random), 0.5 + share(random), 0.1 + share(random)));
  }
  const Mesh mesh = meshOf(boxes);
  const SwallowedWalls walls = swallowedWalls(mesh);
  std::size_t bottoms = 0;
  for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t) {
    const auto corners = cornersOf(mesh, t);
    if (corners[0].z() + corners[1].z() + corners[2].z() > 0) continue;
    EXPECT_FALSE(walls.hidden[t]) << t;
    ++bottoms;
  }
  EXPECT_EQ(bottoms, 2 * boxes.size());
}

TEST(SwallowedWalls, BoxesOnAPlateCutItAlongTheirOutlinesAlone) {
  constexpr int across = 24;
  std::vector<Mesh> parts{test::boxMesh({-1, -1, -1}, {across + 1, across + 1, 0})};
  std::mt19937 random(8);
  std::uniform_real_distribution<double> share(0, 0.4);
  for (int i = 0; i < across * across; ++i) {
    const Vec3d at(i % across + share(random), std::floor(i / across) + share(random), 0);
    parts.push_back(test::boxMesh(at, at + Vec3d(0.5, 0.5, 0.5)));
  }
  const SwallowedWalls walls = swallowedWalls(joined(std::move(parts)));
  EXPECT_EQ(walls.cut, 2U);
  EXPECT_EQ(walls.swallowed, 2U * across * across);
  // The planes of all sides would cut the plate into four times their number squared.
  EXPECT_LT(walls.pieces.triangles.size(), 40U * across * across);
}

TEST(SwallowedWalls, SidesInThePlaneOfAWallCutIt) {
  // The tower's walls have sides at the height of the plate's top, and end there on both sides.
  Mesh tower = test::boxMesh({1, 1, -1}, {2, 2, 1});
  tower.vertices.insert(tower.vertices.end(), {{1, 1, 0}, {2, 1, 0}, {1, 2, 0}, {2, 2, 0}});
  std::vector<Mesh::Triangle> triangles;
  for (const Mesh::Triangle& t : tower.triangles) {
    std::array<std::uint32_t, 3> high{};
    for (std::size_t c = 0; c < 3; ++c) high[c] = tower.vertices[t[c]].z() > 0 ? 1 : 0;
    if (high[0] == high[1] && high[1] == high[2]) {
      triangles.push_back(t);
      continue;
    }
    // Rotated so that the corner that is alone comes first. Its sides are cut at the ring.
    std::size_t alone = 0;
    while (high[alone] == high[(alone + 1) % 3] || high[alone] == high[(alone + 2) % 3]) ++alone;
    const std::uint32_t a = t[alone];
    const std::uint32_t b = t[(alone + 1) % 3];
    const std::uint32_t c = t[(alone + 2) % 3];
    const auto between = [&](std::uint32_t from, std::uint32_t to) {
      const Vec3d middle = 0.5 * (tower.vertices[from] + tower.vertices[to]);
      for (std::uint32_t v = 8; v < tower.vertices.size(); ++v)
        if ((tower.vertices[v] - middle).length() < 1e-9) return v;
      tower.vertices.push_back(middle);
      return static_cast<std::uint32_t>(tower.vertices.size() - 1);
    };
    const std::uint32_t ab = between(a, b);
    const std::uint32_t ac = between(a, c);
    triangles.insert(triangles.end(), {{a, ab, ac}, {ab, b, c}, {ab, c, ac}});
  }
  tower.triangles = triangles;
  const Mesh mesh = joined({test::boxMesh({0, 0, -2}, {3, 3, 0}), tower});
  EXPECT_GT(expectWallsWhereOneSideIsSolid(mesh, 100), 1000U);
}

TEST(SwallowedWalls, TrianglesThatShareACornerCutEachOther) {
  // A star drawn without lifting the pen, drawn up to a point and down to another: all walls meet
  // at these, and each passes through two others.
  Mesh star;
  star.vertices = {{0, 0, 1}, {0, 0, -1}};
  for (int i = 0; i < 5; ++i) {
    const double turn = 4 * std::numbers::pi * i / 5;
    star.vertices.emplace_back(std::cos(turn), std::sin(turn), 0);
  }
  for (std::uint32_t i = 0; i < 5; ++i) {
    const std::uint32_t next = (i + 1) % 5;
    star.triangles.insert(star.triangles.end(), {{0, 2 + i, 2 + next}, {1, 2 + next, 2 + i}});
  }
  expectWallsWhereOneSideIsSolid(star, 100);
  const SwallowedWalls walls = swallowedWalls(star);
  EXPECT_EQ(walls.cut, 10U);
  double left = 0;
  for (std::uint32_t piece = 0; piece < walls.piece_of.size(); ++piece) {
    const auto [a, b, c] = cornersOf(walls.pieces, piece);
    left += (b - a).cross(c - a).length();
  }
  double whole = 0;
  for (std::uint32_t t = 0; t < star.triangles.size(); ++t) {
    const auto [a, b, c] = cornersOf(star, t);
    whole += (b - a).cross(c - a).length();
  }
  // The arms of a pentagram take two parts of its lines that are each the golden ratio squared
  // shorter than the line.
  const double golden = std::numbers::phi;
  EXPECT_NEAR(left / whole, 2 / (golden * golden), 1e-9);
}

TEST(SwallowedWalls, AreTheSameForAnyNumberOfThreads) {
  const Mesh mesh = heapOf(60, {3, 3, 3}, 0.5);
  const SwallowedWalls many = swallowedWalls(mesh);
  const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
  const SwallowedWalls alone = swallowedWalls(mesh);
  EXPECT_EQ(alone.hidden, many.hidden);
  EXPECT_EQ(alone.pieces.vertices, many.pieces.vertices);
  EXPECT_EQ(alone.pieces.triangles, many.pieces.triangles);
  EXPECT_EQ(alone.piece_of, many.piece_of);
  EXPECT_GT(many.cut, 0U);
}

TEST(SwallowedWalls, ASignalEndsTheSearch) {
  testing::GTEST_FLAG(death_test_style) = "threadsafe";
  // Minutes of work, most of it in the search for crossed triangles, or in cutting a few of them.
  EXPECT_EXIT(test::endByInterrupt(std::chrono::milliseconds(300),
                                   [] {
                                     swallowedWalls(heapOf(3000, {1, 1, 1}, 0.3));
                                   }),
              testing::ExitedWithCode(0), "");
  EXPECT_EXIT(
      test::endByInterrupt(std::chrono::milliseconds(1000),
                           [] {
                             std::vector<Mesh> parts;
                             for (int i = 0; i < 2000; ++i) {
                               const double at = 1e-3 * i;
                               parts.push_back(test::boxMesh({at, -1, 0}, {at + 1, 9, 0.6 + at}));
                               parts.push_back(test::boxMesh({-1, at, 0.1}, {9, at + 1, 0.7 + at}));
                             }
                             swallowedWalls(joined(std::move(parts)));
                           }),
      testing::ExitedWithCode(0), "");
}

}  // namespace
}  // namespace vdbdither
