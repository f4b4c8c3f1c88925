#include "ops/kernels/printing/gaussian_spread.h"

#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "ops/kernels/printing/normal_distribution.h"
#include "tests/support/volumes.h"

namespace vdbdither {
namespace {

using openvdb::BoolGrid;
using openvdb::Coord;
using openvdb::CoordBBox;
using openvdb::FloatGrid;
using openvdb::Vec3d;

const Vec3d mimaki_mm(0.042, 0.084, 0.022);

/// The convolution in one sum of doubles, with weights of its own.
double plainShare(const BoolGrid& solid, const CoordBBox& box, const Coord& at,
                  const Vec3d& sigma_mm) {
  std::array<std::vector<double>, 3> weights;
  Coord reach;
  for (int axis = 0; axis < 3; ++axis) {
    reach[axis] = static_cast<int>(std::ceil(4 * sigma_mm[axis] / mimaki_mm[axis] - 0.5));
    double sum = 0;
    auto& of = weights[static_cast<std::size_t>(axis)];
    for (int n = -reach[axis]; n <= reach[axis]; ++n) {
      const double step = mimaki_mm[axis] / sigma_mm[axis];
      of.push_back(normalShare((n + 0.5) * step) - normalShare((n - 0.5) * step));
      sum += of.back();
    }
    for (double& weight : of) weight /= sum;
  }
  double share = 0;
  for (auto near = CoordBBox(at - reach, at + reach).begin(); near; ++near) {
    if (!box.isInside(*near) || !solid.tree().getValue(*near)) continue;
    const Coord n = *near - at + reach;
    share += weights[0][static_cast<std::size_t>(n.x())] *
             weights[1][static_cast<std::size_t>(n.y())] *
             weights[2][static_cast<std::size_t>(n.z())];
  }
  return share;
}

/// A ball, with noise at its surface.
BoolGrid::Ptr ball(const CoordBBox& box) {
  const auto solid = BoolGrid::create(false);
  std::mt19937 random(4);
  std::uniform_real_distribution<double> noise(-0.05, 0.05);
  for (auto ijk = box.begin(); ijk; ++ijk) {
    if (((*ijk).asVec3d() * mimaki_mm - Vec3d(0.4, 0.5, 0.3)).length() < 0.45 + noise(random))
      solid->tree().setValueOn(*ijk, true);
  }
  solid->tree().prune();
  return solid;
}

TEST(GaussianSpread, IsTheConvolutionOfTheVoxelsWithTheGaussian) {
  const CoordBBox box(Coord(-3, -2, -9), Coord(22, 13, 37));
  const auto solid = ball(box);
  for (const Vec3d& sigma_mm : {Vec3d(0.05), Vec3d(0.03, 0.1, 0.06)}) {
    const GaussianSpread spread(mimaki_mm, sigma_mm);
    const auto printed = spread.run(*solid, box, {-9, 38}, {-9, 38});
    int partial = 0;
    for (auto ijk = box.begin(); ijk; ++ijk) {
      if (((*ijk).x() + (*ijk).y() + (*ijk).z()) % 3 != 0) continue;
      const float share = printed->tree().getValue(*ijk);
      ASSERT_NEAR(share, plainShare(*solid, box, *ijk, sigma_mm), 1.2e-5) << *ijk;
      ASSERT_EQ(share != 0, printed->tree().isValueOn(*ijk));
      partial += share > 0.1 && share < 0.9;
    }
    EXPECT_GT(partial, 100);
  }
}

TEST(GaussianSpread, SlabsAndWhatLiesBeyondItsReachChangeNoBit) {
  const CoordBBox box(Coord(-3, -2, -9), Coord(22, 13, 50));
  const auto solid = ball(box);
  const GaussianSpread spread(mimaki_mm, Vec3d(0.05));
  const int reach = spread.reach().z();
  const auto whole = spread.run(*solid, box, {-9, 51}, {-9, 51});
  for (const ZRange core : test::slabsOf({-9, 51})) {
    const ZRange valid = intersection({core.begin - reach, core.end + reach}, {-9, 51});
    const auto slab = spread.run(*solid, box, core, valid);
    for (auto ijk = test::inLayers(box, core).begin(); ijk; ++ijk)
      ASSERT_EQ(slab->tree().getValue(*ijk), whole->tree().getValue(*ijk)) << *ijk;
    const CoordBBox active = slab->evalActiveVoxelBoundingBox();
    EXPECT_TRUE(active.empty() || (active.min().z() >= core.begin && active.max().z() < core.end));
  }
}

TEST(GaussianSpread, IsOneWithinAndHalfOnALargeFace) {
  const CoordBBox box(Coord(-40), Coord(39));
  const auto solid = BoolGrid::create(false);
  solid->tree().sparseFill(CoordBBox(Coord(-40), Coord(39, 39, -1)), true);
  const GaussianSpread spread(mimaki_mm, Vec3d(0.05));
  const auto printed = spread.run(*solid, box, {-40, 40}, {-40, 40});
  EXPECT_EQ(printed->tree().getValue(Coord(0, 0, -16)), 1.0F);
  EXPECT_GT(printed->tree().activeTileCount(), 0U) << "the interior is tiles";
  const float below = printed->tree().getValue(Coord(0, 0, -1));
  const float above = printed->tree().getValue(Coord(0, 0, 0));
  EXPECT_NEAR(below + above, 1, 1e-6) << "the face lies half-way between the voxels";
  EXPECT_NEAR(below, normalShare(0.011 / 0.05), 2e-4);
  EXPECT_EQ(printed->tree().getValue(Coord(0, 0, 12)), 0.0F);
  // Beyond the box there is nothing: its border prints half as much.
  EXPECT_NEAR(printed->tree().getValue(Coord(39, 0, -16)), normalShare(0.021 / 0.05), 2e-4);
}

TEST(GaussianSpread, WithoutSpreadIsTheVoxelsThemselves) {
  const CoordBBox box(Coord(0), Coord(15));
  const auto solid = ball(box);
  const GaussianSpread spread(mimaki_mm, Vec3d(0));
  EXPECT_EQ(spread.reach(), Coord(0));
  const auto printed = spread.run(*solid, box, {0, 16}, {0, 16});
  for (auto ijk = box.begin(); ijk; ++ijk)
    ASSERT_EQ(printed->tree().getValue(*ijk), solid->tree().getValue(*ijk) ? 1.0F : 0.0F);
}

TEST(GaussianSpread, OfNothingIsNothing) {
  const CoordBBox box(Coord(0), Coord(15));
  const GaussianSpread spread(mimaki_mm, Vec3d(0.05));
  EXPECT_TRUE(spread.run(*BoolGrid::create(false), box, {0, 16}, {0, 16})->empty());
}

}  // namespace
}  // namespace vdbdither
