#include "ops/kernels/distance/gradient.h"

#include <gtest/gtest.h>

#include "tests/support/dither_reference.h"

namespace vdbdither {
namespace {

using openvdb::Coord;
using openvdb::Vec3d;
using openvdb::Vec3s;

TEST(OutwardNormals, EqualTheGradientInDoublePrecision) {
  for (const Vec3d& pitch_mm :
       {Vec3d(0.042, 0.084, 0.022), Vec3d(0.04233, 0.08467, 0.027), Vec3d(0.05)}) {
    for (const auto& distance :
         {test::sphere({0.013, -0.02, 0.007}, 0.4), test::torus(Vec3d(0.0), 0.4, 0.15),
          test::box(Vec3d(0.0), Vec3d(0.3), {12, 25, 31})}) {
      const Lattice lattice = test::latticeAround(pitch_mm, Vec3d(0.6), 0.1);
      const auto surface = test::sampled(distance, lattice, 0.15);
      const auto normals = outwardNormals(*surface, pitch_mm, lattice.layers(), lattice.layers());
      EXPECT_EQ(normals->activeVoxelCount(), surface->activeVoxelCount());
      for (auto voxel = normals->cbeginValueOn(); voxel; ++voxel) {
        const Vec3d expected = test::gradientNormal(*surface, voxel.getCoord(), pitch_mm);
        ASSERT_LT((Vec3d(*voxel) - expected).length(), 2e-6) << voxel.getCoord();
      }
    }
  }
}

TEST(OutwardNormals, PointAwayFromTheCentreOfASphere) {
  const Lattice lattice = test::latticeAround({0.042, 0.084, 0.022}, Vec3d(1.0), 0.2);
  const auto surface = test::sampled(test::sphere(Vec3d(0.0), 1), lattice, 0.2);
  const auto normals =
      outwardNormals(*surface, lattice.pitch_mm, lattice.layers(), lattice.layers());
  for (auto voxel = normals->cbeginValueOn(); voxel; ++voxel) {
    const Vec3d outward = lattice.position(voxel.getCoord()).unit();
    ASSERT_GT(outward.dot(Vec3d(*voxel)), 0.995);
    ASSERT_NEAR((*voxel).length(), 1, 1e-6);
  }
}

TEST(LeafNormals, OfEveryInstructionSetAreThoseOfSingleVoxels) {
  const Vec3d pitch_mm(0.042, 0.084, 0.022);
  const Lattice lattice = test::latticeAround(pitch_mm, Vec3d(0.5), 0.1);
  const auto surface = test::sampled(test::sphere(Vec3d(0.01), 0.4), lattice, 0.08);
  const ZRange layers = lattice.layers();
  for (const InstructionSet instructions : {bestInstructionSet(), InstructionSet::baseline}) {
    LeafNormals normals(surface->tree(), pitch_mm, layers, instructions);
    int compared = 0;
    for (auto leaf = surface->tree().cbeginLeaf(); leaf; ++leaf) {
      const LeafBits active = activeBits(*leaf, 0xff);
      normals.visit(*leaf, active);
      std::array<LeafNormals::Row, 64> rows;
      normals.makeRows(rowsOf(active), rows.data());
      forEachBit(active, [&](unsigned offset) {
        const LeafNormals::Row& row = rows[offset / 8];
        const unsigned z = offset % 8;
        ASSERT_EQ(normals.normal(offset), Vec3s(row[0][z], row[1][z], row[2][z])) << offset;
        ++compared;
      });
    }
    EXPECT_GT(compared, 1000);
  }
}

/// Distances 1 mm apart along x, the middle one at the origin.
openvdb::FloatGrid::Ptr threeAlongX(float below, float above) {
  auto grid = openvdb::FloatGrid::create(9.0F);
  grid->tree().setValueOn({-1, 0, 0}, below);
  grid->tree().setValueOn({0, 0, 0}, 0.0F);
  grid->tree().setValueOn({1, 0, 0}, above);
  return grid;
}

Vec3s normalAtOrigin(const openvdb::FloatGrid& grid, ZRange valid = {-8, 8}) {
  return outwardNormals(grid, Vec3d(1.0), {0, 1}, valid)->tree().getValue(Coord(0));
}

TEST(OutwardNormals, AreOneSidedBesideAnInactiveVoxel) {
  auto grid = threeAlongX(-1, 1);
  grid->tree().setValueOn({0, 1, 0}, 0.5F);
  EXPECT_EQ(normalAtOrigin(*grid), Vec3s(2, 1, 0) / std::sqrt(5.0F));
  grid->tree().setValueOff({-1, 0, 0});
  EXPECT_EQ(normalAtOrigin(*grid), Vec3s(2, 1, 0) / std::sqrt(5.0F));
}

TEST(OutwardNormals, AreZeroWhereTheDistanceHasNoDirection) {
  EXPECT_EQ(normalAtOrigin(*threeAlongX(1, 1)), Vec3s(0.0F));
  auto alone = openvdb::FloatGrid::create(9.0F);
  alone->tree().setValueOn({0, 0, 0}, -1.0F);
  EXPECT_EQ(normalAtOrigin(*alone), Vec3s(0.0F));
}

TEST(OutwardNormals, ReadNothingBeyondTheValidLayers) {
  auto grid = threeAlongX(-1, 1);
  grid->tree().setValueOn({0, 0, 1}, 1.0F);
  grid->tree().setValueOn({0, 0, -1}, 5.0F);
  EXPECT_EQ(normalAtOrigin(*grid, {0, 2}), Vec3s(1, 0, 1) / std::sqrt(2.0F));
  EXPECT_EQ(normalAtOrigin(*grid, {0, 1}), Vec3s(1, 0, 0));
}

}  // namespace
}  // namespace vdbdither
