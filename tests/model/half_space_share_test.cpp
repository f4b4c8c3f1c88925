#include "vdbdither/model/half_space_share.h"

#include <random>

#include <gtest/gtest.h>

namespace vdbdither {
namespace {

using openvdb::Vec3d;

const Vec3d mimaki_mm(0.042, 0.084, 0.022);

/// The share of points of a fine grid in the voxel that lie below the plane.
double countedShare(double d_mm, const Vec3d& normal, const Vec3d& pitch_mm) {
  constexpr int points = 60;
  int below = 0;
  for (int x = 0; x < points; ++x) {
    for (int y = 0; y < points; ++y) {
      for (int z = 0; z < points; ++z) {
        const Vec3d at =
            (Vec3d(x + 0.5, y + 0.5, z + 0.5) / points - Vec3d(0.5, 0.5, 0.5)) * pitch_mm;
        below += d_mm + normal.dot(at) < 0 ? 1 : 0;
      }
    }
  }
  return below / std::pow(points, 3);
}

TEST(HalfSpaceShare, IsTheVolumeOfTheVoxelBelowThePlane) {
  std::mt19937 random(3);
  std::normal_distribution<double> any;
  std::uniform_real_distribution<double> depth(-0.08, 0.08);
  for (int n = 0; n < 60; ++n) {
    const Vec3d normal = Vec3d(any(random), any(random), any(random)).unit();
    const double d_mm = depth(random);
    EXPECT_NEAR(halfSpaceShare(d_mm, normal, mimaki_mm), countedShare(d_mm, normal, mimaki_mm),
                0.02)
        << normal << ' ' << d_mm;
  }
}

TEST(HalfSpaceShare, OfTwoSidesAddsUpToOne) {
  for (const Vec3d& normal : {Vec3d(1, 0, 0), Vec3d(0, -1, 0), Vec3d(0.6, 0, 0.8)}) {
    for (const double d_mm : {0.0, 0.004, 0.011, 0.03, 0.2}) {
      EXPECT_NEAR(
          halfSpaceShare(d_mm, normal, mimaki_mm) + halfSpaceShare(-d_mm, normal, mimaki_mm),
          d_mm == 0 ? 2 * halfSpaceShare(0, normal, mimaki_mm) : 1, 1e-12);
    }
  }
  EXPECT_NEAR(halfSpaceShare(0, Vec3d(1, 0, 0), mimaki_mm), 0.5, 1e-9);
}

TEST(HalfSpaceShare, FarFromThePlaneOrWithoutANormalIsAllOrNothing) {
  EXPECT_EQ(halfSpaceShare(0.1, Vec3d(0, 1, 0), mimaki_mm), 0);
  EXPECT_EQ(halfSpaceShare(-0.1, Vec3d(0, 1, 0), mimaki_mm), 1);
  EXPECT_EQ(halfSpaceShare(-0.001, Vec3d(0.0), mimaki_mm), 1);
  EXPECT_EQ(halfSpaceShare(0.001, Vec3d(0.0), mimaki_mm), 0);
}

}  // namespace
}  // namespace vdbdither
