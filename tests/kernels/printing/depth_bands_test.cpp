#include "ops/kernels/printing/depth_bands.h"

#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "tests/support/volumes.h"

namespace vdbdither {
namespace {

using openvdb::BoolGrid;
using openvdb::Coord;
using openvdb::CoordBBox;
using openvdb::Int32Grid;
using openvdb::Vec3d;

/// The definition: every empty voxel around, in double.
double depthMm(const BoolGrid& solid, const Coord& at, const Vec3d& pitch_mm, ZRange valid,
               const Coord& reach) {
  double least = std::numeric_limits<double>::infinity();
  const auto accessor = solid.getConstAccessor();
  for (int x = -reach.x(); x <= reach.x(); ++x) {
    for (int y = -reach.y(); y <= reach.y(); ++y) {
      for (int z = -reach.z(); z <= reach.z(); ++z) {
        const Coord other = at.offsetBy(x, y, z);
        if (valid.contains(other.z()) && accessor.isValueOn(other)) continue;
        least = std::min(least, (Vec3d(x, y, z) * pitch_mm).length());
      }
    }
  }
  return least;
}

void expectMatchesDefinition(const BoolGrid& solid, const Vec3d& pitch_mm, const CoordBBox& region,
                             ZRange core, ZRange valid, std::vector<DepthBand> bands) {
  constexpr std::int32_t beneath = 99;
  const auto result = valueByDepth(solid, pitch_mm, region, core, valid, bands, beneath);
  Coord reach;
  for (int axis = 0; axis < 3; ++axis)
    reach[axis] = static_cast<int>(bands.back().to_mm / pitch_mm[axis]) + 1;
  const auto accessor = result->getConstAccessor();
  for (auto voxel = CoordBBox(Coord(region.min().x(), region.min().y(), core.begin),
                              Coord(region.max().x(), region.max().y(), core.end - 1))
                        .begin();
       voxel; ++voxel) {
    std::int32_t expected = 0;
    if (solid.tree().isValueOn(*voxel)) {
      const double depth = depthMm(solid, *voxel, pitch_mm, valid, reach);
      expected = beneath;
      bool close = false;
      for (std::size_t i = bands.size(); i-- > 0;) {
        if (depth <= bands[i].to_mm) expected = bands[i].value;
        close = close || std::abs(depth - bands[i].to_mm) < 1e-5 * depth;
      }
      if (close) continue;
    }
    std::int32_t value = 0;
    const bool active = accessor.probeValue(*voxel, value);
    ASSERT_EQ(value, expected) << *voxel;
    ASSERT_EQ(active, expected != 0) << *voxel;
  }
}

/// Boxes with holes: corners and thin walls in every direction.
BoolGrid::Ptr cheese(std::uint32_t seed, const CoordBBox& box, int holes) {
  auto grid = BoolGrid::create(false);
  std::mt19937 random(seed);
  grid->fill(box, true, true);
  for (int i = 0; i < holes; ++i) {
    Coord corner;
    for (int axis = 0; axis < 3; ++axis)
      corner[axis] = box.min()[axis] + static_cast<int>(random() % box.dim()[axis]);
    CoordBBox hole(corner,
                   corner.offsetBy(static_cast<int>(random() % 3), static_cast<int>(random() % 3),
                                   static_cast<int>(random() % 6)));
    grid->fill(hole, false, false);
  }
  return grid;
}

TEST(DepthBands, AgreeWithTheDefinitionOnThreeLattices) {
  for (const Vec3d& pitch : {Vec3d(0.042, 0.084, 0.022), Vec3d(25.4 / 600, 25.4 / 300, 0.027),
                             Vec3d(0.05, 0.05, 0.05)}) {
    const CoordBBox box(Coord(-13, 3, -5), Coord(17, 25, 29));
    const auto solid = cheese(1, box, 12);
    expectMatchesDefinition(*solid, pitch, box, {-5, 30}, {-5, 30}, {{0.11, 1}, {0.3, 2}});
  }
}

TEST(DepthBands, AgreeWhereHolesAreManyAndBandsManyBlocksDeep) {
  const CoordBBox box(Coord(0, 0, 0), Coord(40, 12, 40));
  expectMatchesDefinition(*cheese(2, box, 400), {0.02, 0.084, 0.01}, box, {0, 41}, {0, 41},
                          {{0.05, 3}, {0.25, 7}});
}

TEST(DepthBands, ReadNothingBeyondTheirReach) {
  const CoordBBox box(Coord(0, 0, 0), Coord(30, 15, 63));
  const auto solid = cheese(3, box, 60);
  const Vec3d pitch(0.042, 0.084, 0.022);
  const std::vector<DepthBand> bands = {{0.2, 1}};
  const auto whole = valueByDepth(*solid, pitch, box, {0, 64}, {0, 64}, bands, 2);
  const int reach = depthReach(bands, pitch.z());
  EXPECT_EQ(reach, 9);
  for (const ZRange core : test::slabsOf({0, 64})) {
    const ZRange valid = intersection({core.begin - reach, core.end + reach}, {0, 64});
    const auto spoiled = solid->deepCopy();
    const bool rubbish = core.begin % 16 == 0;
    if (valid.begin > 0) spoiled->fill(test::inLayers(box, {0, valid.begin}), rubbish, rubbish);
    const auto part = valueByDepth(*spoiled, pitch, box, core, valid, bands, 2);
    for (auto voxel = test::inLayers(box, core).begin(); voxel; ++voxel) {
      ASSERT_EQ(part->tree().getValue(*voxel), whole->tree().getValue(*voxel)) << *voxel;
    }
  }
}

TEST(DepthBands, ABandOfNStepsHoldsNLayersUnderAFlatFace) {
  auto solid = BoolGrid::create(false);
  const CoordBBox box(Coord(0), Coord(63));
  solid->fill(box, true, true);
  const Vec3d pitch(0.042, 0.084, 0.022);
  for (int steps = 1; steps <= 9; ++steps) {
    const std::vector<DepthBand> bands = {{steps * pitch.z(), 1}};
    const auto result = valueByDepth(*solid, pitch, box, {0, 64}, {0, 64}, bands, 2);
    for (int z = 0; z < 64; ++z) {
      ASSERT_EQ(result->tree().getValue(Coord(30, 30, z)), z < steps || z > 63 - steps ? 1 : 2)
          << steps << " " << z;
    }
  }
}

TEST(DepthBands, TheDeepInteriorStaysTiles) {
  auto solid = BoolGrid::create(false);
  const CoordBBox box(Coord(0), Coord(127));
  solid->fill(box, true, true);
  const std::vector<DepthBand> bands = {{0.1, 1}};
  const auto result = valueByDepth(*solid, {0.05, 0.05, 0.05}, box, {0, 128}, {0, 128}, bands, 2);
  EXPECT_EQ(result->tree().leafCount(), 16 * 16 * 16 - 14 * 14 * 14);
  EXPECT_EQ(result->activeVoxelCount(), 128 * 128 * 128);
}

TEST(DepthBands, NothingComesOfNothing) {
  const std::vector<DepthBand> bands = {{0.1, 1}};
  const auto empty = BoolGrid::create(false);
  EXPECT_TRUE(valueByDepth(*empty, Vec3d(1), CoordBBox(), {0, 8}, {0, 8}, bands, 2)->empty());
  EXPECT_TRUE(
      valueByDepth(*empty, Vec3d(1), CoordBBox(Coord(0), Coord(7)), {0, 8}, {0, 8}, bands, 2)
          ->empty());
}

}  // namespace
}  // namespace vdbdither
