#include "ops/kernels/distance/csg.h"

#include <cmath>

#include <gtest/gtest.h>

#include "ops/kernels/leaf/held_band.h"
#include "tests/support/volumes.h"

namespace vdbdither {
namespace {

using openvdb::Coord;
using openvdb::FloatGrid;
using openvdb::Int32Grid;
using openvdb::Vec3d;

const Vec3d pitch_mm(0.042, 0.084, 0.022);

class CsgTest : public testing::Test {
 protected:
  Lattice lattice = test::latticeAround(pitch_mm, Vec3d(0.9), 0.1);
  test::Distance ball = test::sphere({-0.2, 0, 0}, 0.6);
  test::Distance cube = test::box({0.3, 0.05, 0.1}, Vec3d(0.45), {20, 30, 10});
  FloatGrid::Ptr a = test::sampled(ball, lattice, 0.2);
  FloatGrid::Ptr b = test::sampled(cube, lattice, 0.15);
};

double expectedOf(Csg operation, double a, double b) {
  return operation == Csg::unite       ? std::min(a, b)
         : operation == Csg::intersect ? std::max(a, b)
                                       : std::max(a, -b);
}

TEST_F(CsgTest, GivesTheLesserOrGreaterDistanceWithinTheSmallerBand) {
  for (const Csg operation : {Csg::unite, Csg::intersect, Csg::subtract}) {
    const auto result = combined(*a, *b, operation, lattice.layers());
    EXPECT_EQ(result->background(), 0.15F);
    EXPECT_EQ(heldBandMm(*result), double{0.15F});
    const auto expected = [&](const Vec3d& at) {
      return expectedOf(operation, ball(at), cube(at));
    };
    EXPECT_GT(test::expectHolds(*result, lattice, expected, 0.15), 10000);
  }
}

TEST_F(CsgTest, IsTheSameForAnyCutAndMakesNothingOutsideIt) {
  for (const Csg operation : {Csg::unite, Csg::intersect, Csg::subtract}) {
    const auto whole = combined(*a, *b, operation, lattice.layers());
    for (const ZRange slab : test::slabsOf(lattice.layers())) {
      const ZRange core = intersection({slab.begin + 3, slab.begin + 7}, slab);
      const auto part = combined(*a, *b, operation, core);
      for (const Coord& ijk : lattice.box) {
        float d = 0;
        const bool on = part->tree().probeValue(ijk, d);
        if (core.contains(ijk.z())) {
          ASSERT_EQ(d, whole->tree().getValue(ijk)) << ijk;
        } else {
          ASSERT_TRUE(!on && d == part->background()) << ijk;
        }
      }
    }
  }
}

/// Two half-spaces that meet at a right angle, in a corner that re-enters.
TEST_F(CsgTest, BehindARightAngledReentrantEdgeDistancesAreAtMostRootTwoTooSmall) {
  const auto left = [](const Vec3d& p) { return p.x(); };
  const auto low = [](const Vec3d& p) { return p.z(); };
  const auto result = combined(*test::sampled(left, lattice, 0.3),
                               *test::sampled(low, lattice, 0.3), Csg::unite, lattice.layers());
  double worst = 1;
  for (auto voxel = result->cbeginValueOn(); voxel; ++voxel) {
    const Vec3d at = lattice.position(voxel.getCoord());
    // Of an L-shaped part: within it the nearest point is the edge where both coordinates are
    // below zero, else on one of its two faces.
    const double truth = at.x() < 0 && at.z() < 0     ? -std::hypot(at.x(), at.z())
                         : at.x() >= 0 && at.z() >= 0 ? std::min(at.x(), at.z())
                                                      : std::min(at.x(), at.z());
    if (std::abs(truth) < 1e-6) continue;
    ASSERT_EQ(*voxel < 0, truth < 0);
    const double ratio = truth / double{*voxel};
    ASSERT_GT(ratio, 1 - 1e-5);
    ASSERT_LT(ratio, std::sqrt(2.0) + 1e-5);
    if (truth > 0) {
      ASSERT_NEAR(ratio, 1, 1e-5) << "outside of a union it is exact";
    }
    worst = std::max(worst, ratio);
  }
  EXPECT_GT(worst, 1.39);
}

TEST_F(CsgTest, PartsAreOfWhoseInsideTheyAreThenOfTheFirstThenOfTheNearer) {
  for (const bool b_first : {false, true}) {
    const auto parts = unitedParts(*a, *b, nullptr, nullptr, 1, b_first, lattice.layers());
    for (const Coord& ijk : lattice.box) {
      const bool near_a = a->tree().isValueOn(ijk) || a->tree().getValue(ijk) < 0;
      const bool near_b = b->tree().isValueOn(ijk) || b->tree().getValue(ijk) < 0;
      const float d_a = a->tree().getValue(ijk);
      const float d_b = b->tree().getValue(ijk);
      const int expected = !near_a && !near_b   ? 0
                           : !near_b            ? 1
                           : !near_a            ? 2
                           : d_a < 0 && d_b < 0 ? (b_first ? 2 : 1)
                           : d_b < d_a          ? 2
                                                : 1;
      ASSERT_EQ(parts->tree().getValue(ijk), expected) << ijk;
    }
  }
}

TEST_F(CsgTest, NumbersOfTheSecondFollowThoseOfTheFirst) {
  auto of_a = Int32Grid::create(0);
  auto of_b = Int32Grid::create(0);
  for (const Coord& ijk : lattice.box) {
    if (a->tree().getValue(ijk) < 0) of_a->tree().setValueOn(ijk, ijk.x() < 0 ? 1 : 2);
    if (b->tree().getValue(ijk) < 0) of_b->tree().setValueOn(ijk, ijk.y() < 0 ? 1 : 2);
  }
  const auto parts = unitedParts(*a, *b, of_a.get(), of_b.get(), 2, false, lattice.layers());
  for (const Coord& ijk : lattice.box) {
    const int expected = a->tree().getValue(ijk) < 0   ? (ijk.x() < 0 ? 1 : 2)
                         : b->tree().getValue(ijk) < 0 ? (ijk.y() < 0 ? 3 : 4)
                                                       : 0;
    ASSERT_EQ(parts->tree().getValue(ijk), expected) << ijk;
  }
}

TEST_F(CsgTest, NothingIsNeutral) {
  const auto nothing = FloatGrid::create(0.2F);
  nothing->setTransform(a->transform().copy());
  const auto same = combined(*a, *nothing, Csg::unite, lattice.layers());
  const auto uncut = combined(*a, *nothing, Csg::subtract, lattice.layers());
  for (const Coord& ijk : lattice.box) {
    ASSERT_EQ(same->tree().getValue(ijk), a->tree().getValue(ijk));
    ASSERT_EQ(uncut->tree().getValue(ijk), a->tree().getValue(ijk));
  }
  EXPECT_TRUE(combined(*a, *nothing, Csg::intersect, lattice.layers())->empty());
}

TEST_F(CsgTest, WhatLiesOnTheSurfaceOfTheSecondIsNotTakenAway) {
  const auto slab =
      test::sampled([](const Vec3d& p) { return std::abs(p.z()) - 0.2; }, lattice, 0.15);
  const auto upper = test::sampled([](const Vec3d& p) { return -p.z(); }, lattice, 0.15);
  const auto left = combined(*slab, *upper, Csg::subtract, lattice.layers());
  for (int i = -3; i <= 3; ++i) {
    EXPECT_GE(upper->tree().getValue(Coord(i, 0, 0)), 0) << "outside of the second";
    EXPECT_LT(left->tree().getValue(Coord(i, 0, 0)), 0) << "so it stays";
    EXPECT_GE(left->tree().getValue(Coord(i, 0, 1)), 0);
  }
}

}  // namespace
}  // namespace vdbdither
