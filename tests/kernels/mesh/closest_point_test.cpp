#include "ops/kernels/mesh/closest_point.h"

#include <cmath>
#include <limits>
#include <random>

#include <gtest/gtest.h>

#include "tests/support/shapes.h"
#include "tests/support/volumes.h"

namespace vdbdither {
namespace {

using openvdb::Vec3d;

/// The distance to a triangle as the least over its face and its sides, by projection.
double plainDistance(const Vec3d& a, const Vec3d& b, const Vec3d& c, const Vec3d& p) {
  const Vec3d n = (b - a).cross(c - a).unit();
  const Vec3d foot = p - n * n.dot(p - a);
  const bool within = n.dot((b - a).cross(foot - a)) >= 0 && n.dot((c - b).cross(foot - b)) >= 0 &&
                      n.dot((a - c).cross(foot - c)) >= 0;
  double least = within ? std::abs(n.dot(p - a)) : std::numeric_limits<double>::infinity();
  for (const auto& [from, to] : {std::pair(a, b), std::pair(b, c), std::pair(c, a)}) {
    const double share = std::clamp((p - from).dot(to - from) / (to - from).lengthSqr(), 0.0, 1.0);
    least = std::min(least, (from + share * (to - from) - p).length());
  }
  return least;
}

TEST(ClosestPoints, DistancesAreThoseOfALoopOverAllTriangles) {
  const Mesh mesh =
      test::transformed(test::torusMesh({0, 0, 0}, 0.7, 0.3, 30), {20, 35, 0}, {0.11, 0.2, 0.3});
  const ClosestPoints closest(mesh);
  std::mt19937 random(5);
  std::uniform_real_distribution<double> at(-1.5, 1.5);
  for (int n = 0; n < 2000; ++n) {
    const Vec3d p(at(random), at(random), at(random));
    double least = std::numeric_limits<double>::infinity();
    for (const Mesh::Triangle& t : mesh.triangles) {
      least = std::min(
          least, plainDistance(mesh.vertices[t[0]], mesh.vertices[t[1]], mesh.vertices[t[2]], p));
    }
    const ClosestPoint found = closest(p, static_cast<std::uint32_t>(n) % 300);
    ASSERT_NEAR(std::abs(found.distance_mm), least, 1e-13);
    ASSERT_NEAR((found.point - p).length(), least, 1e-13);
    const Mesh::Triangle& t = mesh.triangles[found.triangle];
    ASSERT_NEAR(plainDistance(mesh.vertices[t[0]], mesh.vertices[t[1]], mesh.vertices[t[2]], p),
                least, 1e-13);
  }
}

TEST(ClosestPoints, SignsAreThoseOfTheSolidAlsoBesideEdgesAndCorners) {
  const Vec3d degrees(20, 35, 10);
  const ClosestPoints closest(
      test::transformed(test::boxMesh({-0.5, -0.3, -0.2}, {0.5, 0.3, 0.2}), degrees, {0, 0, 0}));
  const test::Distance exact = test::box({0, 0, 0}, {0.5, 0.3, 0.2}, degrees);
  std::mt19937 random(6);
  std::uniform_real_distribution<double> at(-0.8, 0.8);
  int inside = 0;
  for (int n = 0; n < 3000; ++n) {
    const Vec3d p(at(random), at(random), at(random));
    const double distance = closest(p).distance_mm;
    ASSERT_NEAR(distance, exact(p), 1e-12) << p;
    inside += distance < 0;
  }
  EXPECT_GT(inside, 100);
}

TEST(ClosestPoints, WhatIsFoundDoesNotDependOnTheHint) {
  const ClosestPoints closest(test::sphereMesh({0, 0, 0}, 1, 12));
  // On the axis all triangles at the pole are equally near; in the middle almost all are.
  for (const Vec3d& p : {Vec3d(0, 0, 2), Vec3d(0, 0, 0), Vec3d(0.2, -1.4, 0.3)}) {
    const ClosestPoint expected = closest(p);
    for (std::uint32_t hint = 0; hint < closest.mesh().triangles.size(); ++hint) {
      const ClosestPoint found = closest(p, hint);
      ASSERT_EQ(found.triangle, expected.triangle);
      ASSERT_EQ(found.distance_mm, expected.distance_mm);
      ASSERT_EQ(found.point, expected.point);
    }
  }
  EXPECT_EQ(closest(Vec3d(0, 0, 2)).triangle, 0U);
}

TEST(ClosestPoints, PointsOnTheMeshAreAtZero) {
  const ClosestPoints closest(test::boxMesh({0, 0, 0}, {1, 1, 1}));
  EXPECT_EQ(closest(Vec3d(1, 1, 1)).distance_mm, 0);
  EXPECT_EQ(closest(Vec3d(0.5, 1, 0.25)).distance_mm, 0);
}

}  // namespace
}  // namespace vdbdither
