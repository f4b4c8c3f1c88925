#include "ops/kernels/measure/histogram.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include <gtest/gtest.h>

namespace vdbdither {
namespace {

using Bins = std::vector<std::tuple<double, double, std::uint64_t>>;

Bins binsOf(const std::vector<double>& values, int most, int minimum_exponent) {
  Histogram histogram(most, minimum_exponent);
  for (const double value : values) histogram.add(value, 1);
  Bins bins;
  for (const Histogram::Bin& bin : histogram.bins()) bins.emplace_back(bin.from, bin.to, bin.count);
  return bins;
}

TEST(Histogram, WholeNumbersGetABinEach) {
  EXPECT_EQ(binsOf({1, 3, 3, -1}, 8, 0),
            (Bins{{-1, 0, 1}, {0, 1, 0}, {1, 2, 1}, {2, 3, 0}, {3, 4, 2}}));
}

TEST(Histogram, BinsDoubleUntilTheyAreFewEnough) {
  EXPECT_EQ(binsOf({-1, 0, 1, 2, 3, 4}, 3, 0), (Bins{{-4, 0, 1}, {0, 4, 4}, {4, 8, 1}}));
}

TEST(Histogram, TheOrderOfValuesDoesNotMatter) {
  std::mt19937 random(7);
  std::vector<double> values;
  for (int i = 0; i < 3000; ++i) {
    values.push_back(
        std::ldexp(static_cast<double>(random()) - 2e9, static_cast<int>(random() % 40) - 60));
  }
  const Bins expected = binsOf(values, 16, -40);
  EXPECT_LE(expected.size(), 16U);
  for (int i = 0; i < 5; ++i) {
    std::shuffle(values.begin(), values.end(), random);
    EXPECT_EQ(binsOf(values, 16, -40), expected);
  }
  std::uint64_t count = 0;
  for (const auto& [from, to, voxels] : expected) {
    count += voxels;
    EXPECT_EQ(voxels, static_cast<std::uint64_t>(std::count_if(
                          values.begin(), values.end(),
                          [from = from, to = to](double v) { return v >= from && v < to; })));
  }
  EXPECT_EQ(count, values.size());
}

TEST(Histogram, HugeValuesAndThoseThatAreNotFiniteAreNoTrouble) {
  const auto bins = binsOf({1e300, -1e300, 0}, 4, -40);
  EXPECT_LE(bins.size(), 4U);
  Histogram histogram(4, -40);
  histogram.add(std::numeric_limits<double>::quiet_NaN(), 3);
  histogram.add(std::numeric_limits<double>::infinity(), 2);
  EXPECT_EQ(histogram.notFinite(), 5U);
  EXPECT_TRUE(histogram.bins().empty());
}

}  // namespace
}  // namespace vdbdither
