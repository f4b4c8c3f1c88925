#include "ops/kernels/measure/span_difference.h"

#include <gtest/gtest.h>

#include "tests/support/span_images.h"

namespace vdbdither {
namespace {

TEST(SpanDifference, TellsLayersPixelsAndValues) {
  const auto is = test::spanImage(7, 3, [](int x, int y) { return (x / 2 + y) % 3; });
  const auto should = test::spanImage(7, 3, [](int x, int y) {
    return x == 4 && y == 1 ? 2 : x == 6 && y == 2 ? 0 : (x / 2 + y) % 3;
  });
  SpanDifference difference;
  difference.add(4, is, is);
  EXPECT_EQ(difference.pixels(), 0U);
  SpanDifference above;
  above.add(5, is, should);
  difference.add(above);
  EXPECT_EQ(difference.pixels(), 2U);
  EXPECT_EQ(difference.layers(), 1U);
  ASSERT_EQ(difference.first().size(), 1U);
  EXPECT_EQ(difference.first()[0].z, 5);
  EXPECT_EQ(difference.first()[0].pixels, 2U);
  EXPECT_EQ(difference.first()[0].first, (std::array<std::uint32_t, 2>{4, 1}));
  EXPECT_EQ(difference.tallies().at(2).missing, 1U);
  EXPECT_EQ(difference.tallies().at(2).extra, 1U);
  EXPECT_EQ(difference.tallies().at(0).extra, 1U);
  EXPECT_EQ(difference.tallies().at(0).missing, 1U);
}

}  // namespace
}  // namespace vdbdither
