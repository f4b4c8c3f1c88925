#pragma once

#include <span>

#include <gtest/gtest.h>

namespace vdbdither::test {

/// Expects coverages that are not negative, of sum 1.
inline void expectCoverages(std::span<const float> coverages) {
  double sum = 0;
  for (const float coverage : coverages) {
    EXPECT_GE(coverage, 0);
    sum += double{coverage};
  }
  EXPECT_NEAR(sum, 1, 1e-6);
}

}  // namespace vdbdither::test
