#include "ops/kernels/dither/tone_curve.h"

#include <cmath>

#include <gtest/gtest.h>

#include "ops/kernels/printing/normal_distribution.h"

namespace vdbdither {
namespace {

/// How far above the bottom of a layer of voxels, 2·k_D thick and printed by the share `tone`, the
/// level ½ lies after a blur.
double levelOf(double tone, double half_diameter, double spread) {
  double low = -4 * spread;
  double high = 2 * half_diameter + 4 * spread;
  for (int step = 0; step < 60; ++step) {
    const double z = (low + high) / 2;
    const double share = (1 - tone) * normalShare(-z / spread) +
                         tone * normalShare((2 * half_diameter - z) / spread);
    (share > 0.5 ? low : high) = z;
  }
  return low;
}

TEST(ToneCurve, LiesBetweenTheCoverageAndTheToneThatPutsTheLevelOntoTheFacet) {
  const ToneCurve tone;
  const double half_diameter = 0.042;
  const double spread = 0.05;
  for (const double d : {-0.04, -0.03, -0.01, 0.0, 0.004, 0.02, 0.037}) {
    const double coverage = 0.5 - d / (2 * half_diameter);
    const double t = tone(static_cast<float>(d), half_diameter, spread);
    const double exact = coverage + (t - coverage) / 0.68;
    EXPECT_NEAR(levelOf(exact, half_diameter, spread), half_diameter - d, 1e-4 * spread) << d;
  }
}

TEST(ToneCurve, IsTheCoverageOfVoxelsThatAreSmallAgainstTheBlur) {
  const ToneCurve tone;
  for (const double d : {-0.0049, -0.002, 0.0, 0.001, 0.0049})
    EXPECT_NEAR(tone(static_cast<float>(d), 0.005, 0.5), 0.5 - d / 0.01, 1e-3) << d;
}

TEST(ToneCurve, FallsWithTheDistanceFromOneToZero) {
  const ToneCurve tone;
  for (const double spread : {0.001, 0.02, 0.05, 1.0}) {
    float before = 1.01F;
    for (int n = -50; n <= 50; ++n) {
      const float t = tone(0.05F * static_cast<float>(n) / 50, 0.05, spread);
      EXPECT_LE(t, before) << n << " " << spread;
      EXPECT_GE(t, 0.0F);
      EXPECT_LE(t, 1.0F);
      EXPECT_NEAR(t + tone(-0.05F * static_cast<float>(n) / 50, 0.05, spread), 1, 1e-6);
      before = t;
    }
  }
}

}  // namespace
}  // namespace vdbdither
