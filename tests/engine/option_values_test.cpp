#include "vdbdither/engine/option_values.h"

#include <limits>
#include <vector>

#include <gtest/gtest.h>

#include "vdbdither/engine/chain.h"
#include "vdbdither/model/errors.h"
#include "vdbdither/model/printable.h"

namespace vdbdither {
namespace {

TEST(OptionValues, LengthsHaveUnits) {
  EXPECT_EQ(parseLengthMm("0.042"), 0.042);
  EXPECT_EQ(parseLengthMm("+0.042mm"), 0.042);
  EXPECT_EQ(parseLengthMm("42um"), 0.042);
  EXPECT_EQ(parseLengthMm("42µm"), 0.042);
  EXPECT_EQ(parseLengthMm("1.5cm"), 15);
  EXPECT_EQ(parseLengthMm("2m"), 2000);
  EXPECT_EQ(parseLengthMm("1in"), 25.4);
  EXPECT_EQ(parseLengthMm("600dpi"), 25.4 / 600);
  for (const char* text : {"", "mm", "dpi", "0dpi", "-300dpi", "1e400", "inf", "nan", "4 2um",
                           "42xm", "1e307m", "1e-320dpi"}) {
    EXPECT_THROW(parseLengthMm(text), UsageError) << text;
  }
}

TEST(OptionValues, ANegativeZeroIsZero) {
  EXPECT_FALSE(std::signbit(parseLengthMm("-0mm")));
  EXPECT_FALSE(std::signbit(parseNumber("-0", {}, "a number")));
}

TEST(OptionValues, RangesHoldTheirBoundsUnlessTheySayOtherwise) {
  const Range closed{1, 2};
  EXPECT_TRUE(closed.contains(1) && closed.contains(2));
  EXPECT_FALSE(closed.contains(0.999) || closed.contains(2.001));
  EXPECT_FALSE(Range::above(1).contains(1));
  EXPECT_TRUE(Range::above(1).contains(1 + 1e-15));
  constexpr double infinity = std::numeric_limits<double>::infinity();
  EXPECT_FALSE(Range().contains(infinity) || Range().contains(-infinity));
  EXPECT_FALSE(Range().contains(std::numeric_limits<double>::quiet_NaN()));
}

TEST(OptionValues, RangesAreToldInWords) {
  EXPECT_EQ(Range().text(), "");
  EXPECT_EQ((Range{1, 9}).text(), "from 1 to 9");
  EXPECT_EQ((Range{0.01, 1}).text("mm"), "from 0.01 mm to 1 mm");
  EXPECT_EQ((Range{.min = 0}).text("mm"), "0 mm or greater");
  EXPECT_EQ((Range{.max = 4}).text(), "4 or less");
  EXPECT_EQ((Range{1e-6, 1e6}).text(), "from 1e-06 to 1000000");
  EXPECT_EQ(Range::above(0).text("mm"), "greater than 0 mm");
  EXPECT_EQ(Range::above(0, 5).text(), "greater than 0, up to 5");
}

TEST(OptionValues, AQuotedWordIsReadBack) {
  for (const std::string word :
       {"plain.stl", "",         "my part", "it's",  "#",       "a|b",
        "!",         "$x",       "\"",      "\\",    "\n",      "tab\there\\'",
        "\x1b[31m",  "\x7f",     "50%",     "é.stl", "a\xff\n", "caf\xe9.stl",
        "\u009b'",   "\u202e\\", "\xc3"}) {
    const std::string quoted = quotedForShell(word);
    EXPECT_EQ(splitWords(quoted), std::vector<std::string>{word}) << quoted;
    EXPECT_TRUE(isPrintable(quoted)) << quoted;
  }
}

TEST(OptionValues, TheNearestWordIsSilentWhereNoneIsNear) {
  const std::vector<std::string> words{"dither", "normals", "slice-export"};
  EXPECT_EQ(nearestWord("dihter", words), "dither");
  EXPECT_EQ(nearestWord("slice-exprot", words), "slice-export");
  EXPECT_EQ(nearestWord("banana", words), "");
}

}  // namespace
}  // namespace vdbdither
