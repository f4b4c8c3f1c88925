#include "vdbdither/model/footprint.h"

#include <gtest/gtest.h>

namespace vdbdither {
namespace {

TEST(Footprint, ScalesAllItsCounts) {
  EXPECT_EQ((Footprint{12, 100, 80}.scaled(0.5)), (Footprint{6, 50, 40}));
}

TEST(Footprint, AddsUpWhatIsKnown) {
  EXPECT_EQ((Footprint{12, 100, 80} + Footprint{3, 20, 10}), (Footprint{15, 120, 90}));
}

TEST(Footprint, TotalsAreUnknownIfThoseOfOneOperandAre) {
  EXPECT_FALSE(Footprint{}.known());
  EXPECT_EQ((Footprint{12, 100, 80} + Footprint{}), (Footprint{12, 0, 0}));
  EXPECT_EQ((Footprint{} + Footprint{12, 100, 80}), (Footprint{12, 0, 0}));
}

}  // namespace
}  // namespace vdbdither
