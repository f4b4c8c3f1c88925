#include "ops/kernels/distance/hollow.h"

#include <cmath>
#include <limits>

#include <gtest/gtest.h>

#include "tests/support/volumes.h"

namespace vdbdither {
namespace {

using openvdb::Coord;
using openvdb::Vec3d;

const Vec3d pitch_mm(0.042, 0.084, 0.022);
const Lattice lattice = test::latticeAround(pitch_mm, Vec3d(1.0), 0.1);

/// The definition: the nearest point of a surface that is sampled densely.
double sampledDistance(const Drain& drain, const Vec3d& position) {
  const Vec3d side = std::abs(drain.direction.x()) < 0.9 ? Vec3d(1, 0, 0) : Vec3d(0, 1, 0);
  const Vec3d u = drain.direction.cross(side).unit();
  const Vec3d v = drain.direction.cross(u);
  double least = std::numeric_limits<double>::infinity();
  const auto take = [&](double along, double radius, double angle) {
    const Vec3d point = drain.centre_mm + drain.direction * along +
                        (u * std::cos(angle) + v * std::sin(angle)) * radius;
    least = std::min(least, (point - position).length());
  };
  for (int turn = 0; turn < 360; ++turn) {
    const double angle = turn * M_PI / 180;
    for (int n = 0; n <= 100; ++n) {
      take((n / 50.0 - 1) * drain.half_length_mm, drain.radius_mm, angle);
      take(drain.half_length_mm, drain.radius_mm * n / 100, angle);
      take(-drain.half_length_mm, drain.radius_mm * n / 100, angle);
    }
  }
  const Vec3d from_centre = position - drain.centre_mm;
  const double along = from_centre.dot(drain.direction);
  const double beside = (from_centre - drain.direction * along).length();
  const bool inside = std::abs(along) < drain.half_length_mm && beside < drain.radius_mm;
  return inside ? -least : least;
}

TEST(Drain, ItsDistanceIsThatOfACylinder) {
  const Drain drain{{0.1, 0.2, -0.3}, Vec3d(1, 2, 2) / 3, 0.5, 0.8};
  for (const Vec3d& at : {Vec3d(0.1, 0.2, -0.3), Vec3d(0.3, 0.5, 0.3), Vec3d(1.5, 0, 0),
                          Vec3d(0.5, 1.2, 0.6), Vec3d(-1, -1, -2), Vec3d(0.4, 0.7, 0.2)}) {
    EXPECT_NEAR(drain.distanceMm(at), sampledDistance(drain, at), 0.015) << at;
  }
}

TEST(Hollow, BothSurfacesOfAHollowBallHaveTheirTrueDistances) {
  const double radius = 0.9;
  const double thickness = 0.3;
  const auto ball = test::sphere({0, 0, 0}, radius);
  const auto shell = hollowed(*test::sampled(ball, lattice, 0.45), lattice, thickness, {}, 0.12F,
                              lattice.layers(), lattice.layers());
  test::expectHolds(
      *shell, lattice, [&](const Vec3d& at) { return std::max(ball(at), -thickness - ball(at)); },
      0.12);
  int inner = 0;
  for (auto voxel = shell->cbeginValueOn(); voxel; ++voxel)
    inner += ball(lattice.position(voxel.getCoord())) < -thickness / 2 ? 1 : 0;
  EXPECT_GT(inner, 1000);
}

TEST(Hollow, ADrainOpensTheShellAndHasATrueDistanceInIt) {
  const auto ball = test::sphere({0, 0, 0}, 0.9);
  const Drain drain{{0, 0, 0.9}, {0, 0, 1}, 0.2, 0.5};
  const std::vector<Drain> drains{drain};
  const auto shell = hollowed(*test::sampled(ball, lattice, 0.45), lattice, 0.3, drains, 0.12F,
                              lattice.layers(), lattice.layers());
  // From the cavity straight up there is no wall any more, and downwards there is.
  for (int z = 0; z < 45; ++z) {
    ASSERT_GT(shell->tree().getValue(Coord(0, 0, z)), 0) << z;
  }
  EXPECT_LT(shell->tree().getValue(Coord(0, 0, -34)), 0);
  for (const Coord& ijk : lattice.box) {
    const Vec3d at = lattice.position(ijk);
    const double d = ball(at);
    const double truth = std::max({d, -(d + 0.3), -drain.distanceMm(at)});
    if (std::abs(std::abs(truth) - 0.12) < 1e-6) continue;
    const float value = shell->tree().getValue(ijk);
    ASSERT_EQ(value < 0, truth < 0) << ijk;
    if (std::abs(truth) < 0.12) {
      ASSERT_NEAR(value, truth, 1e-6) << ijk;
    }
  }
}

TEST(Hollow, WhatIsThinnerThanTwoShellsStaysSolid) {
  const auto ball = test::sphere({0, 0, 0}, 0.25);
  const auto before = test::sampled(ball, lattice, 0.45);
  const auto shell = hollowed(*before, lattice, 0.3, {}, 0.12F, lattice.layers(), lattice.layers());
  for (const Coord& ijk : lattice.box)
    ASSERT_EQ(shell->tree().getValue(ijk) < 0, before->tree().getValue(ijk) < 0) << ijk;
}

TEST(Hollow, ACavityThroughCentresBeginsWithItsLowerFacesAndEndsBeforeItsUpperOnes) {
  const double thickness_mm = 2.5 * pitch_mm.z();
  const Lattice cubes{Vec3d(pitch_mm.z()), Vec3d(0.0), openvdb::CoordBBox(Coord(-9), Coord(8))};
  const auto box = test::box({0, 0, 0}, Vec3d(4.5 * pitch_mm.z()), {0, 0, 0});
  const auto shell = hollowed(*test::sampled(box, cubes, 0.08), cubes, thickness_mm, {}, 0.02F,
                              cubes.layers(), cubes.layers());
  const openvdb::CoordBBox outer(Coord(-4), Coord(4));
  const openvdb::CoordBBox cavity(Coord(-2), Coord(1));
  for (const Coord& ijk : cubes.box)
    ASSERT_EQ(shell->tree().getValue(ijk) < 0, outer.isInside(ijk) && !cavity.isInside(ijk)) << ijk;
}

}  // namespace
}  // namespace vdbdither
