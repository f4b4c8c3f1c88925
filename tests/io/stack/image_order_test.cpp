#include "io/stack/image_order.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "vdbdither/model/errors.h"

namespace vdbdither {
namespace {

using testing::ElementsAre;
using testing::ThrowsMessage;

TEST(ImageOrder, IsThatOfTheNumbers) {
  EXPECT_THAT(inOrderOfNumbers({"s_10.png", "s_8.png", "s_9.png"}, "out"),
              ElementsAre("s_8.png", "s_9.png", "s_10.png"));
  EXPECT_THAT(inOrderOfNumbers({"a/0010.tif", "a/0009.tif"}, "out"),
              ElementsAre("a/0009.tif", "a/0010.tif"));
}

TEST(ImageOrder, FollowsTheNumberThatCountsUp) {
  EXPECT_THAT(inOrderOfNumbers({"v2_z0.10_3.png", "v2_z0.05_2.png", "v2_z0.20_4.png"}, "out"),
              ElementsAre("v2_z0.05_2.png", "v2_z0.10_3.png", "v2_z0.20_4.png"));
  EXPECT_THAT(inOrderOfNumbers({"2_z100.png", "1_z50.png"}, "out"),
              ElementsAre("1_z50.png", "2_z100.png"));
}

TEST(ImageOrder, LeavesOutImagesWithoutANumberUnlessThereIsOneImage) {
  EXPECT_THAT(inOrderOfNumbers({"preview.png", "s1.png", "s2.png"}, "out"),
              ElementsAre("s1.png", "s2.png"));
  EXPECT_THAT(inOrderOfNumbers({"preview.png", "s5.png"}, "out"), ElementsAre("s5.png"));
  EXPECT_THAT(inOrderOfNumbers({"only.png"}, "out"), ElementsAre("only.png"));
}

TEST(ImageOrder, RefusesGapsAndEqualNumbersWithBothNames) {
  EXPECT_THAT(
      [] {
        inOrderOfNumbers({"s1.png", "s2.png", "s4.png", "s5.png"}, "out");
      },
      ThrowsMessage<DataError>("'out': number 3 is missing between 's2.png' and 's4.png'; "
                               "add the slice, or number them without a gap"));
  EXPECT_THAT(
      [] {
        inOrderOfNumbers({"s1.png", "s2.png", "s02.png"}, "out");
      },
      ThrowsMessage<DataError>(
          "'out': 's02.png' and 's2.png' have the same number 2; remove one of them"));
  EXPECT_THAT(
      [] {
        inOrderOfNumbers({"s7.png", "s7.tif"}, "out");
      },
      ThrowsMessage<DataError>(
          "'out': 's7.png' and 's7.tif' have the same number 7; remove one of them"));
}

TEST(ImageOrder, RefusesNamesOfSeveralPatterns) {
  EXPECT_THAT(
      [] {
        inOrderOfNumbers({"black_1.png", "white_1.png"}, "out");
      },
      ThrowsMessage<DataError>("'out': 'black_1.png' and 'white_1.png' are named by "
                               "different patterns; give the one to read, with * for the "
                               "number and in quotes"));
}

}  // namespace
}  // namespace vdbdither
