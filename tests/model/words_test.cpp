#include "vdbdither/model/words.h"

#include <vector>

#include <gtest/gtest.h>

namespace vdbdither {
namespace {

TEST(Words, AreListedAsAlternatives) {
  EXPECT_EQ(alternatives({}), "");
  EXPECT_EQ(alternatives(std::vector<std::string>{"a"}), "a");
  EXPECT_EQ(alternatives(std::vector<std::string>{"a", "b"}), "a or b");
  EXPECT_EQ(alternatives(std::vector<std::string>{"a", "b", "c"}), "a, b or c");
}

}  // namespace
}  // namespace vdbdither
