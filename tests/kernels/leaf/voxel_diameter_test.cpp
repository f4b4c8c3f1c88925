#include "ops/kernels/leaf/voxel_diameter.h"

#include <algorithm>
#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "tests/support/volumes.h"

namespace vdbdither {
namespace {

using openvdb::Vec3d;

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
    EXPECT_DOUBLE_EQ(halfVoxelDiameter(openvdb::Vec3s(0, 0, -1), pitch_mm), pitch_mm.z() / 2);
  }
}

}  // namespace
}  // namespace vdbdither
