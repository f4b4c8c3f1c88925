#include "ops/kernels/measure/surface_area.h"

#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "tests/support/volumes.h"

namespace vdbdither {
namespace {

using openvdb::Coord;
using openvdb::CoordBBox;
using openvdb::FloatGrid;
using openvdb::Vec3d;

const Vec3d pitch_mm{0.042, 0.084, 0.022};

/// Distances within a voxel diagonal, ± it beyond.
FloatGrid::Ptr sampled(const test::Distance& distance, const CoordBBox& box) {
  const double band = pitch_mm.length();
  auto grid = FloatGrid::create(static_cast<float>(band));
  for (auto at = box.begin(); at; ++at) {
    const double d = distance((*at).asVec3d() * pitch_mm);
    if (std::abs(d) <= band) {
      grid->tree().setValue(*at, static_cast<float>(d));
    } else if (d < 0) {
      grid->tree().setValueOff(*at, static_cast<float>(-band));
    }
  }
  return grid;
}

double areaOf(const FloatGrid& grid, const CoordBBox& box) {
  return surfaceArea(grid, grid, {box.min().z(), box.max().z()}, pitch_mm);
}

TEST(SurfaceArea, OfAPlaneIsExact) {
  const CoordBBox box(Coord(-20), Coord(20));
  for (Vec3d normal : {Vec3d(0, 0, 1), Vec3d(1, 2, 3), Vec3d(-1, 0.1, 0.4), Vec3d(1, 0, 0)}) {
    normal.normalize();
    const auto grid = sampled([&](const Vec3d& p) { return normal.dot(p) + 0.001; }, box);
    double expected = 0;
    const CoordBBox middle(Coord(-4), Coord(4));
    const Vec3d size = middle.dim().asVec3d() * pitch_mm;
    // By brute force: slender columns along the axis that is steepest on the lattice.
    const int axis = openvdb::math::MaxIndex(Vec3d(std::abs(normal.x()) * size.x(),
                                                   std::abs(normal.y()) * size.y(),
                                                   std::abs(normal.z()) * size.z()));
    const int u = (axis + 1) % 3;
    const int v = (axis + 2) % 3;
    constexpr int steps = 2000;
    const Vec3d low = middle.min().asVec3d() * pitch_mm;
    const Vec3d high = (middle.max().asVec3d() + 1.0) * pitch_mm;
    for (int i = 0; i < steps; ++i) {
      for (int j = 0; j < steps; ++j) {
        Vec3d p;
        p[u] = low[u] + (high[u] - low[u]) * (i + 0.5) / steps;
        p[v] = low[v] + (high[v] - low[v]) * (j + 0.5) / steps;
        p[axis] = -(0.001 + normal[u] * p[u] + normal[v] * p[v]) / normal[axis];
        if (p[axis] >= low[axis] && p[axis] < high[axis]) {
          expected +=
              (high[u] - low[u]) / steps * (high[v] - low[v]) / steps / std::abs(normal[axis]);
        }
      }
    }
    // Only cells whose least corner lies in the middle count; the other corners may lie beyond.
    for (auto voxel = grid->beginValueOn(); voxel; ++voxel) {
      if (!middle.isInside(voxel.getCoord())) voxel.setActiveState(false);
    }
    const double area = surfaceArea(*grid, *grid, {-4, 5}, pitch_mm);
    EXPECT_NEAR(area / expected, 1, 2e-3) << normal;
  }
}

TEST(SurfaceArea, OfASphereIsWithinAPerMille) {
  const double radius = 1.1;
  const CoordBBox box(Coord(-30, -16, -54), Coord(30, 16, 54));
  const auto grid = sampled(test::sphere(Vec3d(0.01, 0.02, -0.003), radius), box);
  EXPECT_NEAR(areaOf(*grid, box) / (4 * std::numbers::pi * radius * radius), 1, 1e-3);
}

TEST(SurfaceArea, AddsUpExactlyOverSlabs) {
  const CoordBBox box(Coord(-30, -16, -56), Coord(30, 16, 55));
  const auto grid = sampled(test::sphere(Vec3d(0.0), 1.05), box);
  const double whole = surfaceArea(*grid, *grid, {-56, 55}, pitch_mm);
  double sum = 0;
  for (int z = -56; z < 56; z += 8)
    sum += surfaceArea(*grid, *grid, {z, std::min(55, z + 8)}, pitch_mm);
  EXPECT_EQ(sum, whole);
}

}  // namespace
}  // namespace vdbdither
