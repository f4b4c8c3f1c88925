#include "ops/kernels/mesh/winding_surface.h"

#include <cmath>
#include <numbers>
#include <random>

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include "ops/kernels/mesh/winding_number.h"
#include "tests/support/interrupted_work.h"
#include "tests/support/mesh_checks.h"
#include "tests/support/shapes.h"

namespace vdbdither {
namespace {

using openvdb::Vec3d;

constexpr std::size_t few_leaves = 60'000;

/// Of so many random points about the mesh, those that are on another side of the made surface than
/// the exact number says, as a share of those inside.
double shareOfWrongSides(const Mesh& loose, const Mesh& made, int points, double side = 1) {
  const WindingNumber number(loose);
  const WindingNumber of_made(made);
  openvdb::math::BBox<Vec3d> box;
  for (const Vec3d& v : loose.vertices) box.expand(v);
  box.expand(0.1 * box.extents().length());
  std::mt19937 random(7);
  std::uniform_real_distribution<double> uniform(0, 1);
  int wrong = 0;
  int inside = 0;
  for (int i = 0; i < points; ++i) {
    const Vec3d p =
        box.min() + box.extents() * Vec3d(uniform(random), uniform(random), uniform(random));
    const bool expected = side * number.exactAt(p) > 0.5;
    inside += expected;
    wrong += expected != (of_made.at(p) > 0.5);
  }
  EXPECT_GT(inside, points / 50);
  return static_cast<double>(wrong) / inside;
}

TEST(WindingSurface, ACubePulledApartComesBack) {
  const Mesh cube = test::boxMesh({1, 2, 3}, {11, 12, 13});
  const WindingSurface surface = windingSurface(test::pulledApart(cube, 0.05), {}, few_leaves);
  EXPECT_FALSE(surface.turned);
  EXPECT_EQ(test::openSides(surface.mesh), 0U);
  EXPECT_NEAR(test::volumeOf(surface.mesh), 1000, 1);
  for (const Vec3d& v : surface.mesh.vertices) {
    const Vec3d from = v - Vec3d(6, 7, 8);
    const double out = std::max({std::abs(from.x()), std::abs(from.y()), std::abs(from.z())}) - 5;
    ASSERT_LT(std::abs(out), 0.1) << v;
  }
}

TEST(WindingSurface, ASpherePulledApartComesBack) {
  const Mesh sphere = test::sphereMesh({0, 0, 0}, 5, 12);
  const WindingSurface surface = windingSurface(test::pulledApart(sphere, 0.02), {}, few_leaves);
  EXPECT_EQ(test::openSides(surface.mesh), 0U);
  EXPECT_NEAR(test::volumeOf(surface.mesh) / test::volumeOf(sphere), 1, 0.002);
  for (const Vec3d& v : surface.mesh.vertices) ASSERT_NEAR(v.length(), 4.93, 0.1) << v;
}

TEST(WindingSurface, OfAClosedMeshIsTheMesh) {
  const Mesh box = test::boxMesh({0, 0, 0}, {4, 7, 3});
  const WindingSurface surface = windingSurface(box, {}, few_leaves);
  EXPECT_EQ(test::openSides(surface.mesh), 0U);
  EXPECT_NEAR(test::volumeOf(surface.mesh), 84, 1e-3);
}

TEST(WindingSurface, KeepsWallsThinnerThanACoarseCell) {
  // 100 mm long, 0.4 mm thick, in no plane of the cells.
  const Mesh wall = test::transformed(test::boxMesh({0, 0, 0}, {100, 40, 0.4}), {20, 30, 10}, {});
  const WindingSurface surface = windingSurface(test::pulledApart(wall, 0.01), {}, 400'000);
  EXPECT_EQ(test::openSides(surface.mesh), 0U);
  EXPECT_NEAR(test::volumeOf(surface.mesh), 1600, 16);
}

TEST(WindingSurface, PartsTrianglesOfAnyPlaceAsTheirNumberDoes) {
  for (const unsigned seed : {1U, 2U}) {
    const Mesh loose = test::randomTriangles(seed, 24);
    const WindingSurface surface = windingSurface(loose, {}, 200'000);
    EXPECT_EQ(test::openSides(surface.mesh), 0U);
    EXPECT_LT(shareOfWrongSides(loose, surface.mesh, 20'000, surface.turned ? -1 : 1), 0.01);
  }
}

TEST(WindingSurface, FillsAHoleWhereTheNumberIsAHalf) {
  Mesh sphere = test::sphereMesh({0, 0, 0}, 5, 16);
  std::erase_if(sphere.triangles, [&](const Mesh::Triangle& t) {
    return sphere.vertices[t[0]].z() + sphere.vertices[t[1]].z() + sphere.vertices[t[2]].z() > 11;
  });
  const WindingSurface surface = windingSurface(sphere, {}, few_leaves);
  EXPECT_EQ(test::openSides(surface.mesh), 0U);
  EXPECT_LT(shareOfWrongSides(sphere, surface.mesh, 20'000), 0.002);
}

TEST(WindingSurface, TurnsTrianglesThatAllFaceInwards) {
  const Mesh cube = test::pulledApart(test::boxMesh({0, 0, 0}, {3, 3, 3}), 0.01);
  const WindingSurface as_it_is = windingSurface(cube, {}, few_leaves);
  const WindingSurface inwards = windingSurface(test::insideOut(cube), {}, few_leaves);
  EXPECT_FALSE(as_it_is.turned);
  EXPECT_TRUE(inwards.turned);
  EXPECT_NEAR(test::volumeOf(inwards.mesh), test::volumeOf(as_it_is.mesh), 1e-6);
}

TEST(WindingSurface, TrianglesThatEncloseNothingHaveNone) {
  EXPECT_TRUE(windingSurface({}).mesh.triangles.empty());
  const Mesh one{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 2}}};
  EXPECT_TRUE(windingSurface(one, {}, few_leaves).mesh.triangles.empty());
  const Mesh sheet{{{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}}, {{0, 1, 2}, {0, 2, 3}}};
  EXPECT_TRUE(windingSurface(sheet, {}, few_leaves).mesh.triangles.empty());
  const Mesh tilted = test::transformed(sheet, {10, 20, 30}, {5, 6, 7});
  EXPECT_TRUE(windingSurface(tilted, {}, few_leaves).mesh.triangles.empty());
  const Mesh point{{{1, 1, 1}}, {{0, 0, 0}}};
  EXPECT_TRUE(windingSurface(point, {}, few_leaves).mesh.triangles.empty());
  const Mesh line{{{0, 0, 0}, {1, 1, 1}, {2, 2, 2}}, {{0, 1, 2}}};
  EXPECT_TRUE(windingSurface(line, {}, few_leaves).mesh.triangles.empty());
}

TEST(WindingSurface, IsTheSameForAnyNumberOfThreads) {
  const Mesh loose = test::randomTriangles(3, 30);
  const WindingSurface all = windingSurface(loose, {}, few_leaves);
  const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
  const WindingSurface alone = windingSurface(loose, {}, few_leaves);
  EXPECT_EQ(all.mesh.vertices, alone.mesh.vertices);
  EXPECT_EQ(all.mesh.triangles, alone.mesh.triangles);
  EXPECT_GT(all.mesh.triangles.size(), 1000U);
}

TEST(WindingSurface, TangledTrianglesGetLargerCells) {
  const WindingSurface few = windingSurface(test::randomTriangles(3, 30), {}, few_leaves);
  const WindingSurface many = windingSurface(test::randomTriangles(3, 600), {}, few_leaves);
  ASSERT_FALSE(many.mesh.triangles.empty());
  EXPECT_GE(many.cell_mm, 2 * few.cell_mm);
}

TEST(WindingSurface, TellsHowFarItIs) {
  double last = 0;
  windingSurface(
      test::pulledApart(test::boxMesh({0, 0, 0}, {3, 3, 3}), 0.01),
      [&](double fraction) {
        EXPECT_GE(fraction, last);
        EXPECT_LE(fraction, 1);
        last = fraction;
      },
      few_leaves);
  EXPECT_GT(last, 0.5);
}

TEST(WindingSurface, ASignalEndsTheGuess) {
  testing::GTEST_FLAG(death_test_style) = "threadsafe";
  // Triangles of any direction take all cells, which are seconds of work.
  EXPECT_EXIT(test::endByInterrupt(std::chrono::milliseconds(100),
                                   [] { windingSurface(test::randomTriangles(1, 300)); }),
              testing::ExitedWithCode(0), "");
}

}  // namespace
}  // namespace vdbdither
