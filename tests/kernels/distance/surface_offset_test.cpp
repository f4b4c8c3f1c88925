#include "ops/kernels/distance/surface_offset.h"

#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "ops/kernels/dither/shape_dither.h"
#include "ops/kernels/leaf/held_band.h"
#include "tests/support/dither_reference.h"
#include "tests/support/volumes.h"
#include "vdbdither/model/errors.h"

namespace vdbdither {
namespace {

using openvdb::Coord;
using openvdb::CoordBBox;
using openvdb::FloatGrid;
using openvdb::Vec3d;

const Vec3d pitch_mm(0.042, 0.084, 0.022);
const Lattice lattice = test::latticeAround(pitch_mm, Vec3d(0.7), 0.1);
const test::Distance ball = test::sphere({0.01, 0.02, 0.03}, 0.5);

SurfaceOffset offsetOn(double held_mm) {
  SurfaceOffset offset;
  offset.lattice = lattice;
  offset.held_mm = held_mm;
  return offset;
}

/// A map of 7 x 5 pixels of heights between −0.04 and 0.04 mm.
HeightMap bumps(int axis) {
  std::vector<float> heights;
  for (int n = 0; n < 35; ++n) heights.push_back(static_cast<float>(0.04 * std::cos(n * n)));
  return {heights, 7, 5, axis, 0.11, {0.03, -0.02}};
}

TEST(HeightMap, LiesInItsPlaneAndRepeats) {
  // Columns of x and rows of y: 1 2 3 over 4 5 6, the top first.
  const HeightMap map({1, 2, 3, 4, 5, 6}, 3, 2, 2, 2.0, {10, 20});
  EXPECT_EQ(map.minimumMm(), 1);
  EXPECT_EQ(map.maximumMm(), 6);
  EXPECT_DOUBLE_EQ(map.at({11, 21, 77}), 4);
  EXPECT_DOUBLE_EQ(map.at({15, 21, 0}), 6);
  EXPECT_DOUBLE_EQ(map.at({11, 23, 0}), 1);
  EXPECT_DOUBLE_EQ(map.at({12, 22, 0}), 3) << "between four pixels";
  EXPECT_DOUBLE_EQ(map.at({11 + 6 * 3, 21 - 4 * 5, 0}), 4);
  EXPECT_DOUBLE_EQ(HeightMap({1, 2, 3, 4, 5, 6}, 3, 2, 0, 2.0, {10, 20}).at({0, 13, 21}), 5);
  EXPECT_DOUBLE_EQ(HeightMap({1, 2, 3, 4, 5, 6}, 3, 2, 1, 2.0, {10, 20}).at({13, 0, 21}), 5);
}

TEST(SurfaceOffset, OfAConstantMovesTheSurfaceOutwardsWhereItIsAboveZero) {
  const auto surface = test::sampled(ball, lattice, 0.25);
  for (const double by_mm : {0.1, -0.1}) {
    SurfaceOffset offset = offsetOn(0.25);
    offset.constant_mm = by_mm;
    const auto moved = offset.run(*surface, nullptr, lattice.layers(), lattice.layers());
    EXPECT_NEAR(moved->background(), 0.15, 1e-6);
    EXPECT_NEAR(heldBandMm(*moved), 0.15, 1e-6);
    const auto truth = [&](const Vec3d& at) { return ball(at) - by_mm; };
    EXPECT_GT(test::expectHolds(*moved, lattice, truth, 0.15), 1000);
  }
}

TEST(SurfaceOffset, ReadsTheMapAtTheClosestSurfaceVoxel) {
  const auto surface = test::sampled(ball, lattice, 0.2);
  SurfaceOffset offset = offsetOn(0.2);
  offset.map = bumps(2);
  offset.constant_mm = 0.01;
  const auto moved = offset.run(*surface, nullptr, lattice.layers(), lattice.layers());
  const auto surface_voxels =
      test::listed(test::surfaceVoxels(test::plainVoxels(test::dense(*surface, lattice.box))));
  int checked = 0;
  for (auto voxel = moved->cbeginValueOn(); voxel; ++voxel) {
    if (++checked % 7 != 0) continue;
    const Coord ijk = voxel.getCoord();
    const auto closest = test::closestSurfaceVoxel(surface_voxels, ijk, pitch_mm, 1);
    const double height = 0.01 + bumps(2).at(lattice.position(*closest));
    ASSERT_NEAR(*voxel, surface->tree().getValue(ijk) - height, 1e-6) << ijk;
  }
  EXPECT_GT(checked, 10000);
}

TEST(SurfaceOffset, ReadsTheMapAtTheFootPoint) {
  const auto surface = test::sampled(ball, lattice, 0.2);
  SurfaceOffset offset = offsetOn(0.2);
  offset.map = bumps(1);
  offset.at = SurfaceOffset::At::foot;
  const auto moved = offset.run(*surface, nullptr, lattice.layers(), lattice.layers());
  int checked = 0;
  for (auto voxel = moved->cbeginValueOn(); voxel; ++voxel) {
    const Coord ijk = voxel.getCoord();
    const double d = surface->tree().getValue(ijk);
    if (std::abs(d) > 0.1) continue;  // where normals are one-sided they are worse
    const Vec3d normal = (lattice.position(ijk) - Vec3d(0.01, 0.02, 0.03)).unit();
    const double height = bumps(1).at(lattice.position(ijk) - normal * d);
    ASSERT_NEAR(*voxel, d - height, 0.003) << ijk;
    ++checked;
  }
  EXPECT_GT(checked, 5000);
}

TEST(SurfaceOffset, DitheringIsTheOneByMinusF) {
  const auto surface = test::sampled(ball, lattice, 0.25);
  ShapeDither dither;
  dither.pitch_mm = pitch_mm;
  dither.mask = ThresholdMask::whiteNoise(5);
  const auto dithered =
      dither.run(*surface, nullptr, lattice.layers(), lattice.layers(), true).displaced;

  // −f at every surface voxel.
  auto heights = FloatGrid::create(0);
  for (const Coord& ijk :
       test::listed(test::surfaceVoxels(test::plainVoxels(test::dense(*surface, lattice.box))))) {
    const Vec3d normal = test::gradientNormal(*surface, ijk, pitch_mm);
    const double f = 4 * test::halfDiameter(normal, pitch_mm) * (double{dither.mask(ijk)} - 0.5);
    heights->tree().setValueOn(ijk, static_cast<float>(-f));
  }
  SurfaceOffset offset = offsetOn(0.25);
  offset.from_grid = true;
  offset.grid_limit_mm = 0.1;
  const auto moved = offset.run(*surface, heights.get(), lattice.layers(), lattice.layers());
  int active = 0;
  for (auto voxel = moved->cbeginValueOn(); voxel; ++voxel) {
    // Farther away nothing is looked for when dithering.
    const double d = surface->tree().getValue(voxel.getCoord());
    if (std::abs(d) > dither.largestDisplacementMm()) continue;
    ASSERT_NEAR(*voxel, dithered->tree().getValue(voxel.getCoord()), 2e-6) << voxel.getCoord();
    ++active;
  }
  EXPECT_GT(active, 5000);
}

TEST(SurfaceOffset, RefusesHeightsBeyondTheLimit) {
  const auto surface = test::sampled(ball, lattice, 0.25);
  for (const float bad : {0.11F, -0.11F, std::nanf("")}) {
    const auto heights = FloatGrid::create(0);
    heights->fill(lattice.box, bad, true);
    SurfaceOffset offset = offsetOn(0.25);
    offset.from_grid = true;
    offset.grid_limit_mm = 0.1;
    EXPECT_THROW((void)offset.run(*surface, heights.get(), lattice.layers(), lattice.layers()),
                 DataError);
  }
}

TEST(SurfaceOffset, FacesMovedOntoCentresBelongToHalfOpenIntervals) {
  const double edge_mm = pitch_mm.z();
  SurfaceOffset offset;
  offset.lattice = {Vec3d(edge_mm), Vec3d(0.0), openvdb::CoordBBox(Coord(-10), Coord(9))};
  offset.constant_mm = -1.5 * edge_mm;
  offset.held_mm = 4 * edge_mm;
  const auto box = test::box({0, 0, 0}, Vec3d(4.5 * edge_mm), {0, 0, 0});
  const auto layers = offset.lattice.layers();
  const auto moved =
      offset.run(*test::sampled(box, offset.lattice, offset.held_mm), nullptr, layers, layers);
  const openvdb::CoordBBox inside(Coord(-3), Coord(2));
  for (const Coord& ijk : offset.lattice.box)
    ASSERT_EQ(moved->tree().getValue(ijk) < 0, inside.isInside(ijk)) << ijk;
}

}  // namespace
}  // namespace vdbdither
