#include "ops/kernels/colour/seen_colours.h"

#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "ops/kernels/printing/gaussian_spread.h"

namespace vdbdither {
namespace {

using openvdb::Coord;
using openvdb::CoordBBox;
using openvdb::Vec3d;

const Vec3d pitch_mm(0.04, 0.08, 0.02);
const std::vector<Vec3d> colours = {{0.9, 0.9, 0.9}, {0.01, 0.1, 0.4}, {0.6, 0.5, 0.0}};
const CoordBBox box(Coord(-5, -3, 2), Coord(12, 9, 30));

std::array<std::vector<float>, 3> weights(double sigma_mm) {
  const GaussianSpread light(pitch_mm, Vec3d(sigma_mm));
  return {light.weights(0), light.weights(1), light.weights(2)};
}

openvdb::Int32Grid::Ptr speckled() {
  const auto material = openvdb::Int32Grid::create(0);
  std::mt19937 random(3);
  for (auto ijk = box.begin(); ijk; ++ijk)
    if ((*ijk).x() + (*ijk).z() < 28)
      material->tree().setValue(*ijk, 1 + static_cast<std::int32_t>(random() % 3));
  return material;
}

openvdb::FloatGrid::Ptr everywhere() {
  const auto where = openvdb::FloatGrid::create(0);
  where->tree().voxelizeActiveTiles();
  for (auto ijk = box.begin(); ijk; ++ijk) where->tree().setValue(*ijk, 1);
  return where;
}

TEST(SeenColours, AreTheMeansOfThePrintedVoxelsAround) {
  const Vec3d n(1, 2, 2.6);
  const auto material = speckled();
  const auto grid = SeenColours(weights(0.05), colours, {true, true, true}, n)
                        .run(*material, *everywhere(), {2, 31}, {2, 31});
  const auto w = weights(0.05);
  const auto reach = [&](std::size_t axis) { return static_cast<int>(w[axis].size() / 2); };
  int checked = 0;
  for (auto ijk = box.begin(); ijk; ++ijk) {
    if (checked++ % 17 != 0) continue;
    Vec3d sum(0.0);
    double total = 0;
    for (int x = -reach(0); x <= reach(0); ++x)
      for (int y = -reach(1); y <= reach(1); ++y)
        for (int z = -reach(2); z <= reach(2); ++z) {
          const std::int32_t number = material->tree().getValue((*ijk).offsetBy(x, y, z));
          if (number == 0) continue;
          const double weight = double{w[0][static_cast<std::size_t>(x + reach(0))]} *
                                double{w[1][static_cast<std::size_t>(y + reach(1))]} *
                                double{w[2][static_cast<std::size_t>(z + reach(2))]};
          total += weight;
          for (int channel = 0; channel < 3; ++channel)
            sum[channel] +=
                weight *
                std::pow(colours[static_cast<std::size_t>(number - 1)][channel], 1 / n[channel]);
        }
    if (std::abs(total - 1e-3) < 1e-5) continue;
    ASSERT_EQ(grid->tree().isValueOn(*ijk), total >= 1e-3) << *ijk;
    if (total < 1e-3) continue;
    for (int channel = 0; channel < 3; ++channel)
      ASSERT_NEAR(grid->tree().getValue(*ijk)[channel], std::pow(sum[channel] / total, n[channel]),
                  1e-5)
          << *ijk;
  }
}

TEST(SeenColours, OneMaterialShowsItsColour) {
  const auto material = openvdb::Int32Grid::create(0);
  material->tree().fill(box, 2, true);
  const auto grid = SeenColours(weights(0.1), colours, {true, true, true}, Vec3d(2.0))
                        .run(*material, *everywhere(), {2, 31}, {2, 31});
  for (auto voxel = grid->cbeginValueOn(); voxel; ++voxel)
    for (int channel = 0; channel < 3; ++channel)
      ASSERT_NEAR((*voxel)[channel], colours[1][channel], 1e-5);
  EXPECT_GT(grid->activeVoxelCount(), box.volume() - 1);
}

TEST(SeenColours, DoNotDependOnSlabs) {
  const auto material = speckled();
  const SeenColours seen(weights(0.03), colours, {true, true, true}, Vec3d(2.0));
  const auto whole = seen.run(*material, *everywhere(), {0, 32}, {0, 32});
  const int reach = static_cast<int>(weights(0.03)[2].size() / 2);
  for (int begin = 0; begin < 32; begin += 8) {
    const ZRange core{begin, begin + 8};
    const auto slab = seen.run(*material, *everywhere(), core, {begin - reach, begin + 8 + reach});
    for (auto voxel = whole->cbeginValueOn(); voxel; ++voxel) {
      if (!core.contains(voxel.getCoord().z())) continue;
      ASSERT_EQ(slab->tree().getValue(voxel.getCoord()), *voxel);
    }
  }
}

TEST(SeenColours, WhatIsClearHasNoColour) {
  const auto material = openvdb::Int32Grid::create(0);
  for (auto ijk = box.begin(); ijk; ++ijk)
    material->tree().setValue(*ijk, ((*ijk).x() + (*ijk).y() + (*ijk).z()) % 2 == 0 ? 1 : 2);
  const auto grid = SeenColours(weights(0.05), colours, {false, true, true}, Vec3d(2.0))
                        .run(*material, *everywhere(), {2, 31}, {2, 31});
  for (auto voxel = grid->cbeginValueOn(); voxel; ++voxel)
    for (int channel = 0; channel < 3; ++channel)
      ASSERT_NEAR((*voxel)[channel], colours[1][channel], 1e-5);
}

}  // namespace
}  // namespace vdbdither
