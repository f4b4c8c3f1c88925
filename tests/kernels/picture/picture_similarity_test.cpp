#include "ops/kernels/picture/picture_similarity.h"

#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

namespace vdbdither {
namespace {

/// Values from 0 to 1 by a fixed recipe.
Channel drawn(int width, int height, int a, int b, int modulus, int offset = 0) {
  Channel channel(width, height);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x)
      channel.at(x, y) = (x * a + y * b + offset) % modulus / (modulus - 1.0);
  }
  return channel;
}

int mirrored(int i, int size) {
  if (i < 0) return -1 - i;
  return i < size ? i : 2 * size - 1 - i;
}

/// The definition, window by window.
double similarityAt(const Channel& a, const Channel& b, int x, int y) {
  double weights = 0, mean_a = 0, mean_b = 0;
  const auto visit = [&](const auto& with) {
    for (int j = -5; j <= 5; ++j) {
      for (int i = -5; i <= 5; ++i) {
        const int column = mirrored(x + i, a.width);
        const int row = mirrored(y + j, a.height);
        with(std::exp(-(i * i + j * j) / (2 * 1.5 * 1.5)), a.at(column, row), b.at(column, row));
      }
    }
  };
  visit([&](double weight, double va, double vb) {
    weights += weight;
    mean_a += weight * va;
    mean_b += weight * vb;
  });
  mean_a /= weights;
  mean_b /= weights;
  double variance_a = 0, variance_b = 0, covariance = 0;
  visit([&](double weight, double va, double vb) {
    variance_a += weight / weights * (va - mean_a) * (va - mean_a);
    variance_b += weight / weights * (vb - mean_b) * (vb - mean_b);
    covariance += weight / weights * (va - mean_a) * (vb - mean_b);
  });
  return (2 * mean_a * mean_b + 1e-4) * (2 * covariance + 9e-4) /
         ((mean_a * mean_a + mean_b * mean_b + 1e-4) * (variance_a + variance_b + 9e-4));
}

TEST(StructuralSimilarity, IsTheDefinitionAtEveryPixel) {
  const Channel a = drawn(17, 12, 37, 59, 101);
  const Channel b = drawn(17, 12, 29, 43, 97);
  const Channel map = structuralSimilarity(a, b);
  for (int y = 0; y < map.height; ++y) {
    for (int x = 0; x < map.width; ++x)
      EXPECT_NEAR(map.at(x, y), similarityAt(a, b, x, y), 1e-12) << x << " " << y;
  }
}

TEST(StructuralSimilarity, IsOneForTheSameAndBelowZeroForTheNegative) {
  const Channel a = drawn(20, 15, 37, 59, 101);
  Channel negative = a;
  for (double& value : negative.values) value = 1 - value;
  for (const double value : structuralSimilarity(a, a).values) EXPECT_NEAR(value, 1, 1e-12);
  for (const double value : structuralSimilarity(a, negative).values) EXPECT_LT(value, 0);
}

TEST(ContrastSensitivity, FallsFromTheMostVisibleFrequencyAsMannosAndSakrisonMeasured) {
  const auto measured = [](double f) {
    return 2.6 * (0.0192 + 0.114 * f) * std::exp(-std::pow(0.114 * f, 1.1));
  };
  EXPECT_EQ(contrastSensitivity(0), 1);
  EXPECT_EQ(contrastSensitivity(7.5), 1);
  for (const double f : {8.5, 20.0, 50.0}) {
    EXPECT_LT(contrastSensitivity(f), 1);
    EXPECT_NEAR(contrastSensitivity(f) / contrastSensitivity(30), measured(f) / measured(30),
                1e-12);
  }
  EXPECT_NEAR(contrastSensitivity(8.5), 1, 0.01);
}

TEST(SeenByTheEye, AGratingKeepsItsShareAndAPlainGreyAllOfIt) {
  for (const int period : {4, 8, 16}) {
    Channel grating(192, 160);
    for (int y = 0; y < grating.height; ++y) {
      for (int x = 0; x < grating.width; ++x)
        grating.at(x, y) = 0.5 + 0.4 * std::cos(2 * std::numbers::pi * (x + 0.5) / period);
    }
    const double share = contrastSensitivity(100.0 / period);
    const Channel seen = seenByTheEye(grating, 100);
    for (int y = 0; y < grating.height; y += 7) {
      for (int x = 0; x < grating.width; ++x)
        EXPECT_NEAR(seen.at(x, y), 0.5 + share * (grating.at(x, y) - 0.5), 4e-3) << period;
    }
  }
  for (const double value : seenByTheEye(Channel(33, 20, 0.3), 60).values)
    EXPECT_NEAR(value, 0.3, 1e-12);
}

ColourChannels plain(double value) {
  return {Channel(12, 9, value), Channel(12, 9, value), Channel(12, 9, value)};
}

double meanOf(const Channel& channel) {
  double sum = 0;
  for (const double value : channel.values) sum += value;
  return sum / static_cast<double>(channel.values.size());
}

/// The expected values are what NVIDIA's FLIP 1.7 (single precision) says of the same pictures.
TEST(FlipDifference, IsWhatThePublishedProgramSays) {
  ColourChannels a, b;
  for (int channel = 0; channel < 3; ++channel) {
    a[static_cast<std::size_t>(channel)] = drawn(12, 9, 37, 59, 101, 83 * channel);
    b[static_cast<std::size_t>(channel)] = drawn(12, 9, 29, 43, 97, 71 * channel);
  }
  EXPECT_NEAR(meanOf(flipDifference(a, b, 67)), 0.342007, 2e-5);
  EXPECT_NEAR(meanOf(flipDifference(a, b, 30)), 0.686252, 2e-5);
  const Channel map = flipDifference(a, b, 100);
  EXPECT_NEAR(meanOf(map), 0.277647, 2e-5);
  EXPECT_NEAR(map.at(0, 0), 0.59955925, 1e-4);
  EXPECT_NEAR(map.at(6, 4), 0.29421473, 1e-4);
  EXPECT_NEAR(map.at(11, 8), 0.29824612, 1e-4);
  EXPECT_NEAR(meanOf(flipDifference(plain(0), plain(1), 67)), 0.967392, 2e-5);
  EXPECT_EQ(meanOf(flipDifference(a, a, 67)), 0);
}

}  // namespace
}  // namespace vdbdither
