#include "io/job/piece_numbers.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "vdbdither/model/errors.h"

namespace vdbdither {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::ThrowsMessage;

TEST(PieceNumbers, AreSingleOnesAndRanges) {
  EXPECT_THAT(pieceNumbers("7", 8), ElementsAre(7));
  EXPECT_THAT(pieceNumbers("0-2", 3), ElementsAre(0, 1, 2));
  EXPECT_THAT(pieceNumbers("1,3-3,5-6", 7), ElementsAre(1, 3, 5, 6));
}

TEST(PieceNumbers, OfTheTextThatNumbersMakeAreTheseNumbers) {
  for (unsigned set = 1; set < 256; ++set) {
    std::vector<std::size_t> numbers;
    for (std::size_t i = 0; i < 8; ++i) {
      if ((set >> i & 1) != 0) numbers.push_back(i);
    }
    EXPECT_EQ(pieceNumbers(numbersText(numbers), 8), numbers) << numbersText(numbers);
  }
  EXPECT_EQ(numbersText({0, 1, 2, 5, 7, 8}), "0-2,5,7-8");
}

TEST(PieceNumbers, RefuseWhatIsNone) {
  for (const char* text : {"", "8", "0-8", "-1", "3-2", "1,1", "2,1", "0-3,3", "1,", ",1", "a",
                           "1 ", "1-", "-", "0x1", "99999999999999999999"}) {
    EXPECT_THAT([&] { pieceNumbers(text, 8); },
                ThrowsMessage<UsageError>(HasSubstr("give numbers of pieces from 0 to 7")))
        << text;
  }
}

}  // namespace
}  // namespace vdbdither
