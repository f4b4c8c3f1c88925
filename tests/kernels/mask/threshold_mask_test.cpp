#include "ops/kernels/mask/threshold_mask.h"

#include <array>
#include <numeric>
#include <vector>

#include <gtest/gtest.h>

namespace vdbdither {
namespace {

using openvdb::Coord;

TEST(ThresholdMask, AColumnHoldsWhatItsVoxelsHold) {
  std::vector<float> values(std::size_t{2} * 3 * 5);
  std::iota(values.begin(), values.end(), 1.0F);
  for (const ThresholdMask& mask :
       {ThresholdMask({2, 3, 5}, values), ThresholdMask::whiteNoise(7)}) {
    for (const Coord& lowest : {Coord(0, 0, 0), Coord(-3, 7, -9), Coord(11, -2, 4)}) {
      std::array<float, 8> column{};
      mask.column(lowest, column);
      for (int z = 0; z < 8; ++z)
        EXPECT_EQ(column[static_cast<std::size_t>(z)], mask(lowest.offsetBy(0, 0, z)))
            << lowest << " + " << z;
    }
  }
}

}  // namespace
}  // namespace vdbdither
