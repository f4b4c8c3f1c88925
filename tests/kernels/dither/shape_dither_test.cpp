#include "ops/kernels/dither/shape_dither.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <random>

#include <gtest/gtest.h>

#include "ops/kernels/distance/gradient.h"
#include "ops/kernels/distance/mesh_distance.h"
#include "ops/kernels/dither/voxel_diameter.h"
#include "tests/support/dither_reference.h"
#include "tests/support/shapes.h"

namespace vdbdither {
namespace {

using openvdb::Coord;
using openvdb::CoordBBox;
using openvdb::FloatGrid;
using openvdb::Vec3d;
using test::components;
using test::Touching;

/// A tile of ranks in random order: every threshold (rank + ½) / n once.
ThresholdMask permutationMask(int size) {
  std::vector<float> values(static_cast<std::size_t>(size * size * size));
  for (std::size_t n = 0; n < values.size(); ++n) {
    values[n] = (static_cast<float>(n) + 0.5F) / static_cast<float>(values.size());
  }
  std::shuffle(values.begin(), values.end(), std::mt19937(11));
  return {Coord(size), values};
}

double bandFor(const ShapeDither& dither) {
  return dither.largestDisplacementMm() + dither.pitch_mm.length();
}

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
  const auto surface = test::sampled(shape.distance, lattice, bandFor(dither));
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
  const ThresholdMask mask = permutationMask(16);
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
    const ShapeDither dither{lattice.pitch_mm, 4, at, permutationMask(16)};
    const auto surface = test::sampled(test::testShapes()[1].distance, lattice, bandFor(dither));
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
      const ShapeDither dither{pitch_mm, amplitude, DitherAt::voxel, permutationMask(16)};
      const Lattice lattice = test::latticeAround(pitch_mm, Vec3d(0.5), 0.15);
      const auto surface = test::sampled(test::testShapes()[1].distance, lattice, bandFor(dither));
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
  const auto surface =
      test::sampled([&](const Vec3d& at) { return at[axis] - top_mm; }, lattice, bandFor(dither));
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
          EXPECT_NEAR(meanHeightError({test::testPitches()[0], amplitude, at, permutationMask(8)},
                                      axis, offset),
                      0, 0.01)
              << "amplitude " << amplitude << " axis " << axis << " offset " << offset;
        }
      }
    }
  }
}

TEST(ShapeDither, ShiftsTheMeanHeightByUpToAQuarterVoxelAtTheConstantOne) {
  const ShapeDither dither{test::testPitches()[0], 1, DitherAt::closest, permutationMask(8)};
  EXPECT_NEAR(std::max(std::abs(meanHeightError(dither, 2, 0.25)),
                       std::abs(meanHeightError(dither, 2, 0.75))),
              0.25, 0.01);
}

/// The voxels printed of a shape.
struct Printed {
  test::Voxels plain;
  test::Voxels dithered;
};

Printed printed(const ShapeDither& dither, const test::TestShape& shape) {
  const Lattice lattice = test::latticeAround(dither.pitch_mm, shape.extent_mm, 0.3);
  const auto surface = test::sampled(shape.distance, lattice, bandFor(dither));
  const auto result = dither.run(*surface, nullptr, lattice.layers(), lattice.layers(), false);
  return {test::plainVoxels(test::dense(*surface, lattice.box)),
          test::dense(*result.solid, lattice.box)};
}

const test::TestShape ball{"ball", test::sphere({0.013, -0.02, 0.007}, 1.2), Vec3d(1.2)};
const test::TestShape ring{"ring", test::torus({0.01, 0.01, 0}, 0.8, 0.4), {1.2, 1.2, 0.4}};

TEST(ShapeDither, LeavesNoFloatingVoxelsAtTheClosestSurfaceVoxelOrTheFoot) {
  for (const Vec3d& pitch_mm : test::testPitches()) {
    for (const test::TestShape& shape : {ball, ring}) {
      for (const DitherAt at : {DitherAt::closest, DitherAt::foot}) {
        const Printed voxels = printed({pitch_mm, 4, at, ThresholdMask::whiteNoise(1)}, shape);
        EXPECT_EQ(components(voxels.plain, Touching::corners), 1);
        EXPECT_EQ(components(voxels.dithered, Touching::corners), 1)
            << shape.name << " at " << static_cast<int>(at);
      }
    }
  }
}

TEST(ShapeDither, HangsVoxelsOnNoFaceAtTheVoxelItselfButHardlyAnyAtTheClosestSurfaceVoxel) {
  const auto hanging = [](double amplitude, DitherAt at) {
    const Printed voxels =
        printed({test::testPitches()[0], amplitude, at, ThresholdMask::whiteNoise(1)}, ball);
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
  const ThresholdMask mask = permutationMask(16);
  const Lattice lattice = test::latticeAround(pitch_mm, ball.extent_mm, 0.3);
  const auto surface =
      test::sampled(ball.distance, lattice, bandFor({pitch_mm, amplitude, a, mask}));
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
  const Printed voxels =
      printed({test::testPitches()[0], 0, DitherAt::closest, permutationMask(8)}, ring);
  EXPECT_EQ(voxels.plain, voxels.dithered);
}

/// The default.
ShapeDither bestOn(const Vec3d& pitch_mm, bool guarded = true) {
  return {pitch_mm,
          2,
          DitherAt::voxel,
          permutationMask(16),
          std::make_shared<AdaptedAmplitude>(pitch_mm, 0.05),
          guarded};
}

/// Whether a voxel may be overturned, by the definition of the guard in double precision.
bool referenceGuard(const FloatGrid& surface, const Coord& v, const Vec3d& normal,
                    const Vec3d& pitch_mm) {
  const double d = surface.tree().getValue(v);
  const double greatest =
      std::max({std::abs(normal.x()) * pitch_mm.x(), std::abs(normal.y()) * pitch_mm.y(),
                std::abs(normal.z()) * pitch_mm.z()});
  if (greatest == 0) return false;
  Coord step(0);
  double tau = 0;
  for (int axis = 0; axis < 3; ++axis) {
    const double rise = std::abs(normal[axis]) * pitch_mm[axis];
    if (rise < greatest / 1000) continue;
    tau += rise;
    step[axis] = normal[axis] > 0 ? 1 : -1;
  }
  const double band = std::max(greatest, 2 * test::halfDiameter(normal, pitch_mm));
  const double k_D = test::halfDiameter(normal, pitch_mm);
  const int own = d < 0 ? -1 : 1;
  /// On the voxel's own side positive, within the band of one diameter.
  const auto depth = [&](const Coord& at) {
    const double there = own * double{surface.tree().getValue(at)};
    return surface.tree().isValueOn(at) ? std::clamp(there, -band, band)
                                        : std::copysign(band, there);
  };
  const auto stepped = [&](int n) {
    return Coord(v.x() + n * step.x(), v.y() + n * step.y(), v.z() + n * step.z());
  };
  // T of this side, then of the other.
  if (std::abs(d) + tau + depth(stepped(own)) < std::abs(d) + k_D + tau) return false;
  const int m = 1 + static_cast<int>(1.5 * std::abs(d) / tau + 0.95);
  const double beyond = -depth(stepped(-own * m));
  if (beyond <= -band || -std::abs(d) + m * tau + beyond < std::abs(d) + k_D + tau) return false;
  for (int n = 0; n < 27; ++n) {
    const Coord to(n % 3 - 1, n / 3 % 3 - 1, n / 9 - 1);
    const Vec3d by = to.asVec3d() * pitch_mm;
    const double rise = normal.dot(by);
    const double flat = std::clamp(std::abs(d) + own * rise, -band, band);
    const double bend = (by.lengthSqr() - rise * rise) / 0.6;
    const double there = depth(v + to);
    if (std::min(flat, there) < k_D && std::abs(flat - there) > bend + 0.02 * tau) return false;
  }
  return true;
}

TEST(ShapeDither, AdaptedAndGuardedEqualsItsDefinitionInDoublePrecision) {
  int all_spared = 0;
  int all_overturned = 0;
  for (const Vec3d& pitch_mm : test::testPitches()) {
    for (const test::TestShape& shape : test::testShapes()) {
      SCOPED_TRACE(shape.name);
      const ShapeDither dither = bestOn(pitch_mm);
      const Lattice lattice = test::latticeAround(pitch_mm, shape.extent_mm, 0.15);
      const auto surface = test::sampled(shape.distance, lattice, bandFor(dither));
      const auto normals = outwardNormals(*surface, pitch_mm, lattice.layers(), lattice.layers());
      const auto result =
          dither.run(*surface, normals.get(), lattice.layers(), lattice.layers(), true);
      const auto own = dither.run(*surface, nullptr, lattice.layers(), lattice.layers(), false);
      EXPECT_EQ(test::dense(*result.solid, lattice.box), test::dense(*own.solid, lattice.box));
      int overturned = 0;
      int spared = 0;
      for (auto voxel = surface->cbeginValueOn(); voxel; ++voxel) {
        const Coord v = voxel.getCoord();
        const Vec3d normal(normals->tree().getValue(v));
        const FacetDither facet = (*dither.adapted)(openvdb::Vec3s(normal));
        const double k_D = test::halfDiameter(normal, pitch_mm);
        const int parity = (v.x() + v.y() + v.z()) % 2 != 0 ? 1 : -1;
        const double f =
            k_D * (facet.checker * parity / 2.0 + facet.amplitude * (double{dither.mask(v)} - 0.5));
        const double d = *voxel;
        if (std::abs(d + f) < 1e-7) continue;
        bool printed = d + f < 0;
        if (printed != (d < 0)) {
          const bool allowed = referenceGuard(*surface, v, normal, pitch_mm);
          ++(allowed ? overturned : spared);
          if (!allowed) printed = d < 0;
        }
        ASSERT_EQ(result.solid->tree().getValue(v), printed) << v << " d = " << d << " f = " << f;
        ASSERT_EQ(result.displaced->tree().getValue(v) < 0, printed) << v;
      }
      all_overturned += overturned;
      all_spared += spared;
    }
  }
  EXPECT_GT(all_spared, 100);
  EXPECT_GT(all_overturned, 500);
}

TEST(ShapeDither, TheGuardChangesNothingOnASurfaceThatIsThickEverywhere) {
  for (const Vec3d& pitch_mm : test::testPitches()) {
    for (const test::TestShape& shape : {ball, ring})
      EXPECT_EQ(printed(bestOn(pitch_mm), shape).dithered,
                printed(bestOn(pitch_mm, false), shape).dithered);
  }
}

// But for single voxels where facets of the mesh meet at the edge of the band.
TEST(ShapeDither, TheGuardNeedsNoWiderBandThanOneDiameter) {
  for (const Vec3d& pitch_mm : test::testPitches()) {
    for (const Mesh& mesh : {test::sphereMesh({0.013, -0.02, 0.007}, 1.2, 60),
                             test::transformed(test::torusMesh(Vec3d(0.0), 0.8, 0.4, 80),
                                               {20, 35, 10}, Vec3d(0.01))}) {
      const Lattice lattice = test::latticeAround(pitch_mm, Vec3d(1.3), 0.3);
      const auto made = MeshDistance(mesh, lattice, Band{}).run(lattice.layers());
      const auto solid = [&](bool guarded) {
        return test::dense(
            *bestOn(pitch_mm, guarded)
                 .run(*made.surface, nullptr, lattice.layers(), lattice.layers(), false)
                 .solid,
            lattice.box);
      };
      EXPECT_LE(test::differences(solid(true), solid(false)), 5) << pitch_mm;
    }
  }
}

TEST(ShapeDither, AxisAlignedFacetsOnLatticePlanesAreNotDithered) {
  for (const Vec3d& pitch_mm : test::testPitches()) {
    // Faces half way between the centres of voxels.
    const Vec3d half(8.5 * pitch_mm.x(), 5.5 * pitch_mm.y(), 11.5 * pitch_mm.z());
    const test::TestShape block{"block", test::box(Vec3d(0.0), half), half};
    const Printed voxels = printed(bestOn(pitch_mm), block);
    EXPECT_EQ(voxels.dithered, voxels.plain);
  }
}

/// Empty voxels, within `inside`, that are reached by way of neighbours (26) from those with
/// `from` < 0, and have `to` < 0.
bool isTunnelled(const test::Voxels& solid, const Lattice& lattice, const test::Distance& inside,
                 const test::Distance& from, const test::Distance& to) {
  test::Voxels reached(solid.box(), 0);
  std::vector<Coord> front;
  for (auto v = solid.box().begin(); v; ++v) {
    const Vec3d at = lattice.position(*v);
    if (!solid[*v] && inside(at) < 0 && from(at) < 0) {
      reached[*v] = 1;
      front.push_back(*v);
    }
  }
  while (!front.empty()) {
    const Coord v = front.back();
    front.pop_back();
    if (to(lattice.position(v)) < 0) return true;
    for (int n = 0; n < 27; ++n) {
      const Coord w = v + Coord(n % 3 - 1, n / 3 % 3 - 1, n / 9 - 1);
      if (!solid.box().isInside(w) || solid[w] || reached[w] || inside(lattice.position(w)) >= 0)
        continue;
      reached[w] = 1;
      front.push_back(w);
    }
  }
  return false;
}

const std::vector<Vec3d> plate_angles{{0, 0, 0},   {3, 4, 0},  {20, 11, 0}, {45, 0, 0},
                                      {40, 5, 30}, {88, 0, 2}, {3, 87, 10}, {55, 35, 20}};

/// The normal of the wide faces of a box turned by `degrees`.
Vec3d turnedZ(const Vec3d& degrees) {
  const test::Distance plate = test::box(Vec3d(0.0), {50, 50, 1}, degrees);
  Vec3d gradient;
  const Vec3d far = [&] {
    // From far inside the slab the distance rises along ± the normal alone.
    return Vec3d(0.001, 0.002, 0.003);
  }();
  for (int axis = 0; axis < 3; ++axis) {
    Vec3d step(0.0);
    step[axis] = 1e-4;
    gradient[axis] = plate(far + step) - plate(far - step);
  }
  return gradient.unit();
}

TEST(ShapeDither, ThinWallsAreNotOpened) {
  int checked = 0;
  for (const Vec3d& pitch_mm : test::testPitches()) {
    for (const Vec3d& degrees : plate_angles) {
      const Vec3d normal = turnedZ(degrees);
      const double diameter = 2 * test::halfDiameter(normal, pitch_mm);
      for (const double voxels : {1.0, 1.3, 1.7, 2.0, 2.5, 3.0, 4.0}) {
        const double thickness = voxels * diameter;
        const test::TestShape plate{
            "plate", test::box({0.003, 0.004, 0.005}, {0.6, 0.5, thickness / 2}, degrees),
            Vec3d(0.75)};
        const Lattice lattice = test::latticeAround(pitch_mm, plate.extent_mm, 0.3);
        const test::Distance inside =
            test::box({0.003, 0.004, 0.005}, {0.4, 0.3, thickness / 2 + 3 * diameter}, degrees);
        const auto beyond = [&](double side) {
          return
              [=](const Vec3d& at) { return thickness / 2 + 2 * diameter - side * normal.dot(at); };
        };
        const Printed voxels_of = printed(bestOn(pitch_mm), plate);
        if (isTunnelled(voxels_of.plain, lattice, inside, beyond(1), beyond(-1))) continue;
        ++checked;
        EXPECT_FALSE(isTunnelled(voxels_of.dithered, lattice, inside, beyond(1), beyond(-1)))
            << pitch_mm << " " << degrees << " " << voxels;
        EXPECT_EQ(components(voxels_of.dithered, Touching::corners), 1);
      }
    }
  }
  EXPECT_GT(checked, 80);
}

TEST(ShapeDither, OpensThinWallsWithoutTheGuard) {
  const Vec3d pitch_mm = test::testPitches()[0];
  const test::TestShape plate{"plate", test::box(Vec3d(0.0), {0.6, 0.5, 0.016}, {3, 4, 0}),
                              Vec3d(0.75)};
  const Lattice lattice = test::latticeAround(pitch_mm, plate.extent_mm, 0.3);
  const test::Distance inside = test::box(Vec3d(0.0), {0.4, 0.3, 0.1}, {3, 4, 0});
  const auto above = [](const Vec3d& at) { return 0.07 - at.z(); };
  const auto below = [](const Vec3d& at) { return 0.07 + at.z(); };
  const Printed voxels = printed({pitch_mm, 4, DitherAt::closest, permutationMask(16)}, plate);
  EXPECT_FALSE(isTunnelled(voxels.plain, lattice, inside, above, below));
  EXPECT_FALSE(
      isTunnelled(printed(bestOn(pitch_mm), plate).dithered, lattice, inside, above, below));
  EXPECT_TRUE(isTunnelled(voxels.dithered, lattice, inside, above, below));
}

TEST(ShapeDither, NoBarsFuse) {
  int checked = 0;
  int fused_at_ends = 0;
  for (const Vec3d& pitch_mm : test::testPitches()) {
    for (const Vec3d& degrees : plate_angles) {
      const Vec3d normal = turnedZ(degrees);
      const double diameter = 2 * test::halfDiameter(normal, pitch_mm);
      for (const double gap : {1.0, 1.5, 2.0, 3.0}) {
        const double step = (gap + 2.6) * diameter;
        std::vector<test::Distance> bars;
        for (int n = -1; n <= 1; ++n)
          bars.push_back(test::box(n * step * normal, {0.4, 0.35, 1.3 * diameter}, degrees));
        const test::TestShape comb{"comb",
                                   [=](const Vec3d& at) {
                                     return std::min({bars[0](at), bars[1](at), bars[2](at)});
                                   },
                                   Vec3d(1.0)};
        Printed voxels = printed(bestOn(pitch_mm), comb);
        if (components(voxels.plain, Touching::corners) != 3) continue;
        ++checked;
        fused_at_ends += components(voxels.dithered, Touching::corners) != 3;
        // Between the faces, away from the ends of the bars.
        const Lattice lattice = test::latticeAround(pitch_mm, comb.extent_mm, 0.3);
        const test::Distance between = test::box(Vec3d(0.0), {0.28, 0.23, 2}, degrees);
        for (auto v = lattice.box.begin(); v; ++v) {
          if (between(lattice.position(*v)) > 0) voxels.dithered[*v] = voxels.plain[*v] = 0;
        }
        EXPECT_GE(components(voxels.dithered, Touching::corners), 3)
            << pitch_mm << " " << degrees << " " << gap;
      }
    }
  }
  EXPECT_GT(checked, 40);
  // At the ends normals fan out, and the gap is not seen across; one in twenty still touch there.
  EXPECT_LE(fused_at_ends, checked / 20) << "of " << checked;
}

TEST(ShapeDither, MakesNoComponentsOrCavitiesBeyondThePlainOnes) {
  const auto cavities = [](test::Voxels voxels) {
    for (auto v = voxels.box().begin(); v; ++v) voxels[*v] = voxels[*v] ? 0 : 1;
    return components(voxels, Touching::corners);
  };
  const auto cone = [](const Vec3d& at) {  // a slender tip
    const double lateral = std::hypot(at.x(), at.y());
    return std::max(0.985 * lateral - 0.174 * (0.8 - at.z()), -0.7 - at.z());
  };
  const auto wire = [](const Vec3d& from, const Vec3d& to, double radius) {
    return [=](const Vec3d& at) {
      const double share =
          std::clamp((at - from).dot(to - from) / (to - from).lengthSqr(), 0.0, 1.0);
      return (at - from - share * (to - from)).length() - radius;
    };
  };
  std::vector<test::TestShape> pieces{ball, ring, {"tip", cone, Vec3d(0.8)}};
  for (const double radius : {0.03, 0.045, 0.06, 0.09})
    pieces.push_back({"wire", wire({-0.6, -0.5, -0.3}, {0.7, 0.4, 0.5}, radius), Vec3d(0.8)});
  pieces.push_back({"hollow",
                    [](const Vec3d& at) { return std::max(at.length() - 0.7, 0.6 - at.length()); },
                    Vec3d(0.7)});
  for (const Vec3d& pitch_mm : test::testPitches()) {
    for (const test::TestShape& piece : pieces) {
      const Printed voxels = printed(bestOn(pitch_mm), piece);
      EXPECT_EQ(components(voxels.dithered, Touching::corners),
                components(voxels.plain, Touching::corners))
          << piece.name << " " << pitch_mm;
      EXPECT_EQ(cavities(voxels.dithered), cavities(voxels.plain)) << piece.name << " " << pitch_mm;
    }
  }
}

TEST(ShapeDither, SphereVolumeIsUnbiased) {
  for (const Vec3d& pitch_mm : test::testPitches()) {
    const double radius = 2.6;
    const test::TestShape sphere{"sphere", test::sphere({0.013, -0.02, 0.007}, radius),
                                 Vec3d(radius)};
    const Printed voxels = printed(bestOn(pitch_mm), sphere);
    double count = 0;
    for (auto v = voxels.dithered.box().begin(); v; ++v) count += voxels.dithered[*v];
    const double truth = 4 * std::acos(-1.0) / 3 * radius * radius * radius;
    EXPECT_NEAR(count * pitch_mm.product() / truth, 1, 2e-4) << pitch_mm;
  }
}

TEST(HalfVoxelDiameter, IsTheDistanceToTheBoundaryAlongTheNormal) {
  std::mt19937 random(5);
  std::normal_distribution<double> normal;
  for (const Vec3d& pitch_mm : test::testPitches()) {
    for (int n = 0; n < 1000; ++n) {
      const openvdb::Vec3s along(Vec3d(normal(random), normal(random), normal(random)).unit());
      const Vec3d exit_voxels = Vec3d(along) * halfVoxelDiameter(along, pitch_mm) / pitch_mm;
      const double farthest = std::max(
          {std::abs(exit_voxels.x()), std::abs(exit_voxels.y()), std::abs(exit_voxels.z())});
      ASSERT_NEAR(farthest, 0.5, 1e-12);
      ASSERT_LE(halfVoxelDiameter(along, pitch_mm), pitch_mm.length() / 2 * (1 + 1e-7));
    }
    EXPECT_EQ(halfVoxelDiameter(openvdb::Vec3s(0.0F), pitch_mm), 0);
    EXPECT_DOUBLE_EQ(halfVoxelDiameter({0, 0, -1}, pitch_mm), pitch_mm.z() / 2);
  }
}

}  // namespace
}  // namespace vdbdither
