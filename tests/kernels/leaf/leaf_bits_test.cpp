#include "ops/kernels/leaf/leaf_bits.h"

#include <random>

#include <gtest/gtest.h>

namespace vdbdither {
namespace {

TEST(LeafBits, HaveTheRowsThatHoldASetBit) {
  std::mt19937_64 random(5);
  for (int turn = 0; turn < 200; ++turn) {
    LeafBits bits;
    for (std::uint64_t& word : bits) {
      word = ~std::uint64_t{0};
      for (int n = 0; n < turn % 8; ++n) word &= random();
    }
    std::uint64_t expected = 0;
    forEachBit(bits, [&](unsigned offset) { expected |= std::uint64_t{1} << offset / 8; });
    ASSERT_EQ(rowsOf(bits), expected);
  }
}

}  // namespace
}  // namespace vdbdither
