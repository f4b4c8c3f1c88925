#include "ops/kernels/mesh/triangle_and_cube.h"

#include <algorithm>
#include <cmath>
#include <random>

#include <gtest/gtest.h>

namespace vdbdither {
namespace {

using openvdb::Vec3d;

TEST(MeetsCube, WhereSomePointOfTheTriangleIsInTheCube) {
  std::mt19937 random(2);
  std::uniform_real_distribution<double> uniform(-3, 3);
  int meet = 0;
  for (int i = 0; i < 2000; ++i) {
    std::array<Vec3d, 3> at;
    for (Vec3d& corner : at) corner = {uniform(random), uniform(random), uniform(random)};
    double nearest = 10;  // of points of the triangle, by their greatest coordinate
    constexpr int steps = 100;
    for (int u = 0; u <= steps; ++u)
      for (int v = 0; u + v <= steps; ++v) {
        const Vec3d p =
            at[0] + (at[1] - at[0]) * (1.0 * u / steps) + (at[2] - at[0]) * (1.0 * v / steps);
        nearest = std::min(nearest, std::max({std::abs(p.x()), std::abs(p.y()), std::abs(p.z())}));
      }
    if (std::abs(nearest - 1) < 0.1) continue;  // the steps are too coarse to tell
    meet += nearest < 1;
    ASSERT_EQ(meetsCube(at, {0, 0, 0}, 1), nearest < 1) << at[0] << at[1] << at[2];
  }
  EXPECT_GT(meet, 200);
}

}  // namespace
}  // namespace vdbdither
