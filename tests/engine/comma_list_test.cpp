#include "vdbdither/engine/comma_list.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace vdbdither {
namespace {

using testing::ElementsAre;

TEST(CommaList, HasOnePieceMoreThanCommas) {
  EXPECT_THAT(commaList("surface,N"), ElementsAre("surface", "N"));
  EXPECT_THAT(commaList("42um"), ElementsAre("42um"));
  EXPECT_THAT(commaList("1,,3,"), ElementsAre("1", "", "3", ""));
  EXPECT_THAT(commaList(""), ElementsAre(""));
  EXPECT_THAT(commaList(" a , b "), ElementsAre(" a ", " b "));
}

}  // namespace
}  // namespace vdbdither
