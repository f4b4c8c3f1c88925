#include "ops/kernels/dither/shape_dither.h"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "ops/kernels/distance/gradient.h"
#include "tests/support/dither_reference.h"

namespace vdbdither {
namespace {

using openvdb::Coord;
using openvdb::CoordBBox;
using openvdb::FloatGrid;
using openvdb::Vec3d;
using test::components;
using test::Touching;

/// d′ of every active voxel by the equations, in double precision; NaN elsewhere.
test::Volume<double> referenceDisplaced(const ShapeDither& dither, const FloatGrid& surface,
                                        const CoordBBox& box) {
  const Vec3d& pitch_mm = dither.pitch_mm;
  const auto d = test::dense(surface, box);
  const auto surface_voxels = test::listed(test::surfaceVoxels(test::plainVoxels(d)));
  const auto f = [&](const Coord& u) {
    if (!surface.tree().isValueOn(u)) return 0.0;
    const double k_D = test::halfDiameter(test::gradientNormal(surface, u, pitch_mm), pitch_mm);
    return dither.amplitude * k_D * (double{dither.mask(u)} - 0.5);
  };
  test::Volume<double> displaced(box, std::nan(""));
  for (auto v = box.begin(); v; ++v) {
    if (!surface.tree().isValueOn(*v)) continue;
    if (dither.at == DitherAt::voxel) {
      displaced[*v] = double{d[*v]} + f(*v);
    } else if (dither.at == DitherAt::foot) {
      const Vec3d foot_mm =
          (*v).asVec3d() * pitch_mm - double{d[*v]} * test::gradientNormal(surface, *v, pitch_mm);
      displaced[*v] = double{d[*v]} + f(Coord::round(foot_mm / pitch_mm));
    } else {
      const auto closest =
          test::closestSurfaceVoxel(surface_voxels, *v, pitch_mm, dither.searchRadiusMm());
      displaced[*v] = double{d[*v]} + (closest ? f(*closest) : 0.0);
    }
  }
  return displaced;
}

void compareWithReference(const ShapeDither& dither, const test::TestShape& shape) {
  const Lattice lattice = test::latticeAround(dither.pitch_mm, shape.extent_mm, 0.15);
  const auto surface = test::sampled(shape.distance, lattice, test::bandFor(dither));
  const auto expected = referenceDisplaced(dither, *surface, lattice.box);
  const auto result = dither.run(*surface, nullptr, lattice.layers(), lattice.layers(), true);
  const auto plain = dither.run(*surface, nullptr, lattice.layers(), lattice.layers(), false);
  EXPECT_FALSE(plain.displaced);

  int displaced = 0;
  for (auto v = lattice.box.begin(); v; ++v) {
    const float d = surface->tree().getValue(*v);
    const bool active = surface->tree().isValueOn(*v);
    const bool printed = result.solid->tree().getValue(*v);
    ASSERT_EQ(printed, active ? expected[*v] < 0 : d < 0)
        << *v << " d = " << d << " d' = " << expected[*v];
    ASSERT_EQ(printed, plain.solid->tree().getValue(*v)) << *v;
    ASSERT_EQ(printed, result.solid->tree().isValueOn(*v)) << *v;
    ASSERT_NEAR(result.displaced->tree().getValue(*v), active ? expected[*v] : d, 1e-7) << *v;
    displaced += printed != (d < 0);
  }
  EXPECT_GT(displaced, 10);
}

TEST(ShapeDither, EqualsTheEquationsInDoublePrecision) {
  const ThresholdMask mask = test::permutationMask(16);
  for (const Vec3d& pitch_mm : test::testPitches()) {
    for (const test::TestShape& shape : test::testShapes()) {
      for (const DitherAt at : {DitherAt::closest, DitherAt::foot, DitherAt::voxel}) {
        for (const double amplitude : {2.0, 4.0}) {
          SCOPED_TRACE(std::string(shape.name) + " at " + std::to_string(static_cast<int>(at)));
          compareWithReference({pitch_mm, amplitude, at, mask}, shape);
        }
      }
    }
  }
}

TEST(ShapeDither, EqualsTheEquationsAtTheLargestAmplitudeAndWithWhiteNoise) {
  for (const test::TestShape& shape : test::testShapes())
    compareWithReference(
        {test::testPitches()[0], 8, DitherAt::closest, ThresholdMask::whiteNoise(3)}, shape);
}

TEST(ShapeDither, MakesTheSameOfGivenNormalsAsOfItsOwn) {
  const Lattice lattice = test::latticeAround(test::testPitches()[0], Vec3d(0.5), 0.15);
  for (const DitherAt at : {DitherAt::closest, DitherAt::foot, DitherAt::voxel}) {
    const ShapeDither dither{lattice.pitch_mm, 4, at, test::permutationMask(16)};
    const auto surface =
        test::sampled(test::testShapes()[1].distance, lattice, test::bandFor(dither));
    const auto normals =
        outwardNormals(*surface, lattice.pitch_mm, lattice.layers(), lattice.layers());
    const auto with = dither.run(*surface, normals.get(), lattice.layers(), lattice.layers(), true);
    const auto without = dither.run(*surface, nullptr, lattice.layers(), lattice.layers(), true);
    EXPECT_EQ(test::dense(*with.displaced, lattice.box),
              test::dense(*without.displaced, lattice.box));
    EXPECT_TRUE(with.solid->tree().hasSameTopology(without.solid->tree()));
  }
}

TEST(ShapeDither, AtTheVoxelIsTheThresholdedTonalValue) {
  for (const Vec3d& pitch_mm : test::testPitches()) {
    for (const double amplitude : {2.0, 4.0}) {
      const ShapeDither dither{pitch_mm, amplitude, DitherAt::voxel, test::permutationMask(16)};
      const Lattice lattice = test::latticeAround(pitch_mm, Vec3d(0.5), 0.15);
      const auto surface =
          test::sampled(test::testShapes()[1].distance, lattice, test::bandFor(dither));
      const auto result = dither.run(*surface, nullptr, lattice.layers(), lattice.layers(), false);
      for (auto voxel = surface->cbeginValueOn(); voxel; ++voxel) {
        const Coord v = voxel.getCoord();
        const double k_D =
            test::halfDiameter(test::gradientNormal(*surface, v, pitch_mm), pitch_mm);
        if (k_D == 0) continue;
        const double tone =
            std::clamp(-double{*voxel} / (amplitude * k_D), -1.0, 1.0) + 0.5;             // (7)
        ASSERT_EQ(tone > double{dither.mask(v)}, result.solid->tree().getValue(v)) << v;  // (1)
      }
    }
  }
}

/// How high a half space is printed whose surface lies `height` voxels up `axis`: the mean over 8 ×
/// 8 columns.
double meanHeight(const ShapeDither& dither, int axis, double height) {
  const int level = static_cast<int>(std::floor(height));
  CoordBBox columns(Coord(0), Coord(7));
  columns.min()[axis] = level - 10;
  columns.max()[axis] = level + 10;
  Lattice lattice{dither.pitch_mm, Vec3d(0.0), columns};
  for (const int beside : {(axis + 1) % 3, (axis + 2) % 3}) {
    lattice.box.min()[beside] -= 10;
    lattice.box.max()[beside] += 10;
  }
  const double top_mm = (height - 0.5) * dither.pitch_mm[axis];
  const auto surface = test::sampled([&](const Vec3d& at) { return at[axis] - top_mm; }, lattice,
                                     test::bandFor(dither));
  const auto result = dither.run(*surface, nullptr, lattice.layers(), lattice.layers(), false);
  int printed = 0;
  for (auto v = columns.begin(); v; ++v) printed += result.solid->tree().getValue(*v);
  return printed / 64.0 + columns.min()[axis];
}

/// The error of the mean height over eight planes, one per layer of the mask: together they see
/// each of its thresholds once.
double meanHeightError(const ShapeDither& dither, int axis, double offset) {
  double error = 0;
  for (int level = -3; level < 5; ++level)
    error += meanHeight(dither, axis, level + offset) - (level + offset);
  return error / 8;
}

TEST(ShapeDither, KeepsTheMeanHeightOfAnAxisParallelPlane) {
  for (const DitherAt at : {DitherAt::closest, DitherAt::foot, DitherAt::voxel}) {
    for (const double amplitude : {2.0, 4.0}) {
      for (int axis = 0; axis < 3; ++axis) {
        for (const double offset : {0.0, 0.13, 0.37, 0.5, 0.71, 0.94}) {
          EXPECT_NEAR(
              meanHeightError({test::testPitches()[0], amplitude, at, test::permutationMask(8)},
                              axis, offset),
              0, 0.01)
              << "amplitude " << amplitude << " axis " << axis << " offset " << offset;
        }
      }
    }
  }
}

TEST(ShapeDither, ShiftsTheMeanHeightByUpToAQuarterVoxelAtTheConstantOne) {
  const ShapeDither dither{test::testPitches()[0], 1, DitherAt::closest, test::permutationMask(8)};
  EXPECT_NEAR(std::max(std::abs(meanHeightError(dither, 2, 0.25)),
                       std::abs(meanHeightError(dither, 2, 0.75))),
              0.25, 0.01);
}

TEST(ShapeDither, LeavesNoFloatingVoxelsAtTheClosestSurfaceVoxelOrTheFoot) {
  for (const Vec3d& pitch_mm : test::testPitches()) {
    for (const test::TestShape& shape : {test::ballShape(), test::ringShape()}) {
      for (const DitherAt at : {DitherAt::closest, DitherAt::foot}) {
        const test::Printed voxels =
            test::printed({pitch_mm, 4, at, ThresholdMask::whiteNoise(1)}, shape);
        EXPECT_EQ(components(voxels.plain, Touching::corners), 1);
        EXPECT_EQ(components(voxels.dithered, Touching::corners), 1)
            << shape.name << " at " << static_cast<int>(at);
      }
    }
  }
}

TEST(ShapeDither, HangsVoxelsOnNoFaceAtTheVoxelItselfButHardlyAnyAtTheClosestSurfaceVoxel) {
  const auto hanging = [](double amplitude, DitherAt at) {
    const test::Printed voxels = test::printed(
        {test::testPitches()[0], amplitude, at, ThresholdMask::whiteNoise(1)}, test::ballShape());
    return components(voxels.dithered, Touching::faces) - 1;
  };
  EXPECT_GT(hanging(4, DitherAt::voxel), 100);
  EXPECT_LT(hanging(4, DitherAt::closest), 3);
  EXPECT_EQ(hanging(2, DitherAt::closest), 0);
}

/// Among the voxels that f may overturn, |d| < ½ amplitude·k_D, those that two readings decide
/// differently.
struct Disagreement {
  double inside = 0;  ///< share of the band's voxels with d < 0
  double outside = 0;
};

Disagreement disagreement(const Vec3d& pitch_mm, double amplitude, DitherAt a, DitherAt b) {
  const ThresholdMask mask = test::permutationMask(16);
  const Lattice lattice = test::latticeAround(pitch_mm, test::ballShape().extent_mm, 0.3);
  const auto surface = test::sampled(test::ballShape().distance, lattice,
                                     test::bandFor({pitch_mm, amplitude, a, mask}));
  const auto solid = [&](DitherAt at) {
    return ShapeDither{pitch_mm, amplitude, at, mask}
        .run(*surface, nullptr, lattice.layers(), lattice.layers(), false)
        .solid;
  };
  const auto solid_a = solid(a);
  const auto solid_b = solid(b);
  int band[2] = {0, 0};
  int differing[2] = {0, 0};
  for (auto voxel = surface->cbeginValueOn(); voxel; ++voxel) {
    const Coord v = voxel.getCoord();
    const Vec3d outward = (lattice.position(v) - Vec3d(0.013, -0.02, 0.007)).unit();
    if (std::abs(*voxel) >= amplitude / 2 * test::halfDiameter(outward, pitch_mm)) continue;
    const int side = *voxel < 0 ? 0 : 1;
    ++band[side];
    differing[side] += solid_a->tree().getValue(v) != solid_b->tree().getValue(v);
  }
  return {static_cast<double>(differing[0]) / band[0], static_cast<double>(differing[1]) / band[1]};
}

TEST(ShapeDither, AtTheConstantTwoTheFootLiesInTheVoxelItself) {
  for (const Vec3d& pitch_mm : test::testPitches()) {
    const Disagreement foot = disagreement(pitch_mm, 2, DitherAt::voxel, DitherAt::foot);
    EXPECT_LT(foot.inside, 1e-3);
    EXPECT_LT(foot.outside, 1e-3);
  }
}

TEST(ShapeDither, AtTheConstantTwoAVoxelInsideIsItsOwnClosestSurfaceVoxel) {
  for (const Vec3d& pitch_mm : test::testPitches()) {
    const Disagreement closest = disagreement(pitch_mm, 2, DitherAt::voxel, DitherAt::closest);
    EXPECT_LT(closest.inside, 0.005);
    // One outside is never: it reads another threshold, as random as its own.
    EXPECT_NEAR(closest.outside, 0.33, 0.03);
  }
}

TEST(ShapeDither, AtTheConstantFourAboutAFifthOfTheBandDependsOnWhereTheMaskIsRead) {
  for (const Vec3d& pitch_mm : test::testPitches()) {
    const Disagreement closest = disagreement(pitch_mm, 4, DitherAt::voxel, DitherAt::closest);
    EXPECT_NEAR((closest.inside + closest.outside) / 2, 0.19, 0.03);
  }
}

TEST(ShapeDither, IsPlainVoxelizationWithoutAmplitude) {
  const test::Printed voxels = test::printed(
      {test::testPitches()[0], 0, DitherAt::closest, test::permutationMask(8)}, test::ringShape());
  EXPECT_EQ(voxels.plain, voxels.dithered);
}

}  // namespace
}  // namespace vdbdither
