#include "vdbdither/model/instruction_set.h"

#include <cstdlib>

#include <gtest/gtest.h>

namespace vdbdither {
namespace {

TEST(InstructionSet, IsTheBaselineOnDemand) {
  const InstructionSet best = bestInstructionSet();
  ASSERT_EQ(setenv("VDBDITHER_INSTRUCTIONS", "baseline", 1), 0);
  EXPECT_EQ(bestInstructionSet(), InstructionSet::baseline);
  ASSERT_EQ(setenv("VDBDITHER_INSTRUCTIONS", "avx2", 1), 0);
  EXPECT_EQ(bestInstructionSet(), best);
  ASSERT_EQ(unsetenv("VDBDITHER_INSTRUCTIONS"), 0);
#if defined(__x86_64__)
  EXPECT_EQ(best == InstructionSet::avx2, __builtin_cpu_supports("avx2") != 0);
#endif
}

}  // namespace
}  // namespace vdbdither
