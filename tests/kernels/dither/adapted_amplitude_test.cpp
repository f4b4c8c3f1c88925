#include "ops/kernels/dither/adapted_amplitude.h"

#include <cmath>
#include <numbers>
#include <random>

#include <gtest/gtest.h>

namespace vdbdither {
namespace {

using openvdb::Vec3d;
using openvdb::Vec3s;

const std::vector<Vec3d> lattices{
    {0.042, 0.084, 0.022}, {25.4 / 600, 25.4 / 300, 0.027}, {0.05, 0.05, 0.05}};

Vec3d tilted(int axis, double degrees, double azimuth = 40) {
  const double tilt = degrees * std::numbers::pi / 180;
  const double turn = azimuth * std::numbers::pi / 180;
  Vec3d normal;
  normal[axis] = std::cos(tilt);
  normal[(axis + 1) % 3] = std::sin(tilt) * std::cos(turn);
  normal[(axis + 2) % 3] = std::sin(tilt) * std::sin(turn);
  return normal;
}

TEST(AdaptedAmplitude, IsOneQuantizationStepUpToTwoDegrees) {
  for (const Vec3d& pitch_mm : lattices) {
    for (int axis = 0; axis < 3; ++axis) {
      for (const double degrees : {0.0, 0.1, 0.3, 1.0, 2.0}) {
        const FacetDither facet = bestFacetDither(tilted(axis, degrees), pitch_mm, 0.05);
        EXPECT_EQ(facet.amplitude, 2) << axis << " " << degrees;
        EXPECT_EQ(facet.checker, 0);
      }
    }
  }
}

TEST(AdaptedAmplitude, LeavesStairsThatTheProcessBlursToTheCheckerboard) {
  // Stairs of 22 µm are 0.25 mm long at 5°, of 84 µm 0.33 mm at 14°.
  for (const auto& [axis, degrees] : {std::pair(2, 5.0), std::pair(1, 14.0)}) {
    const FacetDither facet = bestFacetDither(tilted(axis, degrees), lattices[0], 0.05);
    EXPECT_LE(facet.amplitude, 0.5);
    EXPECT_EQ(facet.checker, 1);
  }
}

TEST(AdaptedAmplitude, BreaksTheLongWavesOfHighOrder) {
  // Stairs of 50 µm at a slope of 1 in n are blurred away by themselves, and the checkerboard is
  // all that the first ones need; but from strip to strip the steps fall on the same places.
  for (const int n : {4, 5, 6}) {
    EXPECT_GT(bestFacetDither(Vec3d(1, 0, n).unit(), lattices[2], 0.05).amplitude, 0) << n;
    EXPECT_GT(bestFacetDither(Vec3d(0, n, 1).unit(), lattices[2], 0.05).amplitude, 0) << n;
  }
}

TEST(AdaptedAmplitude, IsTheSameForNormalsThatTheLatticeTakesIntoEachOther) {
  std::mt19937 random(5);
  std::normal_distribution<double> normal;
  for (int n = 0; n < 50; ++n) {
    const Vec3d at = Vec3d(normal(random), normal(random), normal(random)).unit();
    const FacetDither facet = bestFacetDither(at, lattices[2], 0.05);
    for (const Vec3d& like : {Vec3d(at.y(), at.z(), at.x()), Vec3d(at.y(), at.x(), -at.z()), -at}) {
      const FacetDither other = bestFacetDither(like, lattices[2], 0.05);
      EXPECT_EQ(other.checker, facet.checker);
      EXPECT_EQ(other.amplitude, facet.amplitude);
    }
  }
}

TEST(AdaptedAmplitude, DependsOnLengthsByTheirRatiosAlone) {
  for (int axis = 0; axis < 3; ++axis) {
    for (const double degrees : {0.5, 2.0, 7.0, 20.0, 45.0}) {
      const FacetDither fine = bestFacetDither(tilted(axis, degrees), lattices[0], 0.05);
      const FacetDither coarse = bestFacetDither(tilted(axis, degrees), lattices[0] * 4.0, 0.2);
      EXPECT_EQ(fine.amplitude, coarse.amplitude);
      EXPECT_EQ(fine.checker, coarse.checker);
    }
  }
}

TEST(AdaptedAmplitude, NeverDisplacesByMoreThanHalfADiameter) {
  const AdaptedAmplitude adapted(lattices[0], 0.05);
  std::mt19937 random(3);
  std::normal_distribution<float> normal;
  for (int n = 0; n < 10000; ++n) {
    Vec3s at(normal(random), normal(random), normal(random));
    at.normalize();
    const FacetDither facet = adapted(at);
    ASSERT_GE(facet.checker, 0);
    ASSERT_GE(facet.amplitude, 0);
    ASSERT_LE(facet.checker + facet.amplitude, 2);
  }
}

TEST(AdaptedAmplitude, OfTheTableIsThatOfAFacetNearBy) {
  for (const Vec3d& pitch_mm : lattices) {
    const AdaptedAmplitude adapted(pitch_mm, 0.05);
    std::mt19937 random(3);
    std::normal_distribution<double> normal;
    int same = 0;
    for (int n = 0; n < 300; ++n) {
      const Vec3d at = Vec3d(normal(random), normal(random), normal(random)).unit();
      const FacetDither looked_up = adapted(Vec3s(at));
      const FacetDither exact = bestFacetDither(at, pitch_mm, 0.05);
      same += looked_up.checker == exact.checker && looked_up.amplitude == exact.amplitude;
      const FacetDither mirrored = adapted(Vec3s(Vec3d(-at.x(), at.y(), -at.z())));
      ASSERT_EQ(looked_up.checker, mirrored.checker);
      ASSERT_EQ(looked_up.amplitude, mirrored.amplitude);
    }
    EXPECT_GT(same, 210);
  }
}

struct Choice {
  float checker, amplitude;
};

struct CoarseLattice {
  Vec3d pitch_mm;
  std::vector<Choice> choices;
};

/// What the sum over all waves that the blur leaves chooses, computed once without a bound on their
/// number: for facets tilted from x and from z by 1°, 3°, 8°, 20°, 35° and 50°.
const std::vector<CoarseLattice> coarse_lattices{{{0.1, 0.1, 0.1},
                                                  {{0, 2},
                                                   {0, 2},
                                                   {0, 2},
                                                   {0, 2},
                                                   {1, 0.5},
                                                   {1, 0.5},
                                                   {0, 0},
                                                   {0, 0},
                                                   {0, 0},
                                                   {0, 0},
                                                   {0, 0},
                                                   {0, 0}}},
                                                 {{0.2, 0.2, 0.2},
                                                  {{1, 0.5},
                                                   {1, 0.5},
                                                   {1, 0.5},
                                                   {1, 0.5},
                                                   {1, 0.25},
                                                   {1, 0.25},
                                                   {0, 0},
                                                   {0, 0},
                                                   {0, 0},
                                                   {0, 0},
                                                   {0, 0},
                                                   {0, 0}}},
                                                 {{0.4, 0.4, 0.4},
                                                  {{0.5, 0},
                                                   {0.5, 0},
                                                   {0.5, 0},
                                                   {0.5, 0},
                                                   {0.5, 0},
                                                   {0.5, 0},
                                                   {0, 0},
                                                   {0, 0},
                                                   {0, 0},
                                                   {0, 0},
                                                   {0, 0},
                                                   {0, 0}}},
                                                 {{1, 1, 1},
                                                  {{0, 0},
                                                   {0, 0},
                                                   {0, 0},
                                                   {0, 0},
                                                   {0, 0},
                                                   {0, 0},
                                                   {0, 0},
                                                   {0, 0},
                                                   {0, 0},
                                                   {0, 0},
                                                   {0, 0},
                                                   {0, 0}}},
                                                 {{1, 0.1, 0.1},
                                                  {{0, 2},
                                                   {1, 0},
                                                   {0, 2},
                                                   {1, 0},
                                                   {1, 1},
                                                   {1, 0},
                                                   {1, 1},
                                                   {1, 0},
                                                   {1, 1},
                                                   {0, 0},
                                                   {1, 0},
                                                   {1, 0}}},
                                                 {{0.6, 0.6, 0.1},
                                                  {{1, 0.25},
                                                   {0, 0},
                                                   {1, 0.25},
                                                   {0, 0},
                                                   {1, 0},
                                                   {0, 0},
                                                   {1, 0},
                                                   {0, 0},
                                                   {1, 0},
                                                   {0, 0},
                                                   {1, 0},
                                                   {0, 0}}},
                                                 {{0.5, 0.005, 0.5},
                                                  {{1, 1},
                                                   {1, 1},
                                                   {1, 1},
                                                   {1, 1},
                                                   {1, 1},
                                                   {1, 1},
                                                   {1, 1},
                                                   {1, 1},
                                                   {1, 0},
                                                   {1, 1},
                                                   {1, 0},
                                                   {1, 0}}},
                                                 {{0.1, 0.1, 10},
                                                  {{1, 0},
                                                   {1, 1},
                                                   {1, 0},
                                                   {1, 1},
                                                   {1, 0},
                                                   {1, 1},
                                                   {0, 0},
                                                   {1, 0},
                                                   {0, 0},
                                                   {1, 0},
                                                   {0, 0},
                                                   {1, 0}}}};

TEST(AdaptedAmplitude, OnCoarseLatticesIsThatOfAllWaves) {
  for (const CoarseLattice& lattice : coarse_lattices) {
    auto expected = lattice.choices.begin();
    for (const double degrees : {1.0, 3.0, 8.0, 20.0, 35.0, 50.0}) {
      for (const int axis : {0, 2}) {
        const FacetDither facet = bestFacetDither(tilted(axis, degrees), lattice.pitch_mm, 0.05);
        EXPECT_EQ(facet.checker, expected->checker) << lattice.pitch_mm << degrees << axis;
        EXPECT_EQ(facet.amplitude, expected->amplitude) << lattice.pitch_mm << degrees << axis;
        ++expected;
      }
    }
  }
}

TEST(AdaptedAmplitude, IsFoundForAllFacetsOfAnyLattice) {
  // Without a bound on the waves, each of the first lattices takes minutes or hours.
  for (const Vec3d& pitch_mm : {Vec3d(10, 10, 10), Vec3d(10, 0.1, 10), Vec3d(0.1, 10, 10),
                                Vec3d(0.5, 0.005, 0.5), Vec3d(0.005, 0.005, 0.005)}) {
    const AdaptedAmplitude adapted(pitch_mm, 0.05);
    std::mt19937 random(7);
    std::normal_distribution<float> normal;
    for (int n = 0; n < 20000; ++n) {
      Vec3s at(normal(random), normal(random), normal(random));
      at.normalize();
      const FacetDither facet = adapted(at);
      ASSERT_LE(facet.checker + facet.amplitude, 2);
      // A voxel of 10 mm cannot hide in a blur of 0.1 mm.
      if (pitch_mm == Vec3d(10, 10, 10)) {
        ASSERT_EQ(facet.checker, 0);
        ASSERT_EQ(facet.amplitude, 0);
      }
    }
  }
}

TEST(AdaptedAmplitude, IsNothingForTheZeroVector) {
  const FacetDither facet = AdaptedAmplitude(lattices[0], 0.05)(Vec3s(0.0F));
  EXPECT_EQ(facet.checker, 0);
  EXPECT_EQ(facet.amplitude, 0);
}

}  // namespace
}  // namespace vdbdither
