#include "ops/kernels/mesh/winding_number.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

#include <gtest/gtest.h>

#include "tests/support/shapes.h"

namespace vdbdither {
namespace {

using openvdb::Vec3d;

TEST(WindingNumber, IsOneInsideAClosedSurfaceAHalfOnItAndZeroOutside) {
  const Mesh mesh = test::boxMesh({-1, -1, -1}, {1, 1, 1});
  const WindingNumber winding(mesh);
  EXPECT_NEAR(winding.exactAt({0.2, 0.3, -0.4}), 1, 1e-12);
  EXPECT_NEAR(winding.exactAt({0.2, 0.3, 1}), 0.5, 1e-12);
  EXPECT_NEAR(winding.exactAt({0.2, 0.3, 1.4}), 0, 1e-12);
}

TEST(WindingNumber, TheFastOneIsCloseToTheExactOneOnClosedAndOpenSurfaces) {
  Mesh mesh = test::torusMesh({0, 0, 0}, 0.8, 0.3, 60);
  std::mt19937 random(1);
  std::uniform_real_distribution<double> uniform(-1.5, 1.5);
  for (int open = 0; open < 2; ++open) {
    const WindingNumber winding(mesh);
    int inside = 0;
    for (int i = 0; i < 2000; ++i) {
      const Vec3d p(uniform(random), uniform(random), 0.3 * uniform(random));
      const double exact = winding.exactAt(p);
      inside += exact > 0.5;
      ASSERT_NEAR(winding.at(p), exact, 0.02) << p;
    }
    EXPECT_GT(inside, 200);
    mesh.triangles.resize(mesh.triangles.size() * 3 / 4);
  }
}

TEST(WindingNumber, TheCloseOneIsWithinHalfAThousandth) {
  Mesh mesh = test::torusMesh({0, 0, 0}, 0.8, 0.3, 60);
  std::mt19937 random(2);
  std::uniform_real_distribution<double> uniform(-1.5, 1.5);
  for (int open = 0; open < 2; ++open) {
    const WindingNumber winding(mesh);
    double worst = 0;
    for (int i = 0; i < 2000; ++i) {
      const Vec3d p(uniform(random), uniform(random), 0.3 * uniform(random));
      double solid_angles = 0;
      for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t)
        solid_angles += solidAngle(cornersOf(mesh, t), p);
      const double exact = solid_angles / (4 * std::numbers::pi);
      worst = std::max(worst, std::abs(winding.closelyAt(p) - exact));
    }
    EXPECT_LT(worst, 0.0005);
    EXPECT_GT(worst, 1e-9) << "groups count as dipoles";
    mesh.triangles.resize(mesh.triangles.size() * 3 / 4);
  }
}

TEST(WindingNumber, ItsGradientIsThatOfTheExactOne) {
  Mesh mesh = test::torusMesh({0, 0, 0}, 0.8, 0.3, 60);
  mesh.triangles.resize(mesh.triangles.size() / 2);
  const WindingNumber winding(mesh);
  std::mt19937 random(1);
  std::uniform_real_distribution<double> uniform(-1.5, 1.5);
  for (int i = 0; i < 200; ++i) {
    const Vec3d p(uniform(random), uniform(random), 0.3 * uniform(random));
    const Vec3d gradient = winding.gradientAt(p);
    Vec3d expected;
    constexpr double step = 1e-6;
    for (int axis = 0; axis < 3; ++axis) {
      Vec3d aside(0.0);
      aside[axis] = step;
      expected[axis] = (winding.exactAt(p + aside) - winding.exactAt(p - aside)) / (2 * step);
    }
    ASSERT_LT((gradient - expected).length(), 0.03 * expected.length() + 1e-3) << p;
  }
}

TEST(WindingNumber, OfNoTrianglesIsZero) {
  const Mesh mesh;
  EXPECT_EQ(WindingNumber(mesh).at({1, 2, 3}), 0);
}

}  // namespace
}  // namespace vdbdither
