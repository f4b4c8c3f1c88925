#include "ops/kernels/leaf/part_index.h"

#include <array>

#include <gtest/gtest.h>

#include "tests/support/volumes.h"

namespace vdbdither {
namespace {

using openvdb::CoordBBox;
using openvdb::FloatGrid;
using openvdb::Vec3d;

/// Two overlapping spheres and, of both, what a plain loop over all voxels says.
TEST(PartIndex, TheFirstThatHoldsAVoxelOwnsItElseTheNearest) {
  const Vec3d pitch_mm(0.042, 0.084, 0.022);
  const double band_mm = 0.15;
  const Lattice lattice = test::latticeAround(pitch_mm, Vec3d(1.6, 1.0, 1.0), 0.1);
  const std::array<test::Distance, 2> parts{test::sphere({-0.6, 0, 0}, 0.9),
                                            test::sphere({0.6, 0, 0}, 0.9)};
  std::vector<FloatGrid::ConstPtr> surfaces;
  for (const test::Distance& part : parts)
    surfaces.push_back(test::sampled(part, lattice, band_mm));
  const auto index = partIndex(surfaces);
  const auto read = index->getConstAccessor();
  std::array<int, 3> seen{};
  for (const openvdb::Coord& ijk : lattice.box) {
    const double a = surfaces[0]->tree().getValue(ijk);
    const double b = surfaces[1]->tree().getValue(ijk);
    const bool near_a = surfaces[0]->tree().isValueOn(ijk);
    const bool near_b = surfaces[1]->tree().isValueOn(ijk);
    int expected = 0;
    if (a < 0) {
      expected = 1;
    } else if (b < 0) {
      expected = 2;
    } else if (near_a || near_b) {
      expected = near_a && (!near_b || a <= b) ? 1 : 2;
    }
    ASSERT_EQ(read.getValue(ijk), expected) << ijk;
    ++seen[static_cast<std::size_t>(expected)];
  }
  for (const int count : seen) EXPECT_GT(count, 1000);
  EXPECT_GT(index->tree().activeTileCount(), 0U);
}

}  // namespace
}  // namespace vdbdither
