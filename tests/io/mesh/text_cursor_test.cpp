#include "io/mesh/text_cursor.h"

#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <random>
#include <string>
#include <vector>

#include <gtest/gtest.h>

namespace vdbdither {
namespace {

std::optional<double> number(const std::string& text) { return TextCursor(text).number(); }

TEST(TextCursor, ReadsNumbersAsTheCLibraryDoes) {
  std::mt19937_64 random(5);
  const std::array<const char*, 6> formats{"%.6f", "%e", "%.17g", "%.0f", "%.9g", "%.14E"};
  for (int i = 0; i < 60000; ++i) {
    const double scale = std::pow(10.0, static_cast<double>(random() % 60) - 30);
    const double value = (static_cast<double>(random()) / 1e19 - 1) * scale;
    std::array<char, 400> text{};
    std::snprintf(text.data(), text.size(), formats[random() % formats.size()], value);
    const auto read = number(text.data());
    ASSERT_TRUE(read) << text.data();
    ASSERT_EQ(*read, std::strtod(text.data(), nullptr)) << text.data();
  }
}

TEST(TextCursor, ReadsNumbersInEveryForm) {
  EXPECT_EQ(number("12"), 12.0);
  EXPECT_EQ(number("  +1.5 "), 1.5);
  EXPECT_EQ(number(".5"), 0.5);
  EXPECT_EQ(number("5."), 5.0);
  EXPECT_EQ(number("1E+2\t"), 100.0);
  EXPECT_EQ(number("1e-2\r"), 0.01);
  EXPECT_EQ(number("1e22"), 1e22);
  EXPECT_EQ(number("1e23"), 1e23);
  EXPECT_EQ(number("999999999999999e22"), 999999999999999e22);
  EXPECT_EQ(number("9007199254740993"), 9007199254740992.0);
  EXPECT_TRUE(std::signbit(*number("-0.0")));
  EXPECT_EQ(number("1e-400"), 0.0);
  EXPECT_EQ(number("-1e400"), -std::numeric_limits<double>::infinity());
  EXPECT_EQ(number("inf"), std::numeric_limits<double>::infinity());
  EXPECT_TRUE(std::isnan(*number("nan")));
}

TEST(TextCursor, LeavesOtherWordsWhereTheyAre) {
  for (const char* text : {"", "x", ".", "-", "+", "+-1", "--1", "1,5", "1.5.2", "1e", "1e+",
                           "0x10", "1/2", "1.#QNAN", "- 1"}) {
    const std::string line = text;
    TextCursor cursor(line);
    EXPECT_FALSE(cursor.number()) << text;
    EXPECT_EQ(cursor.position(), line.data()) << text;
  }
}

TEST(TextCursor, EndsLinesInAnyStyle) {
  const std::string text = "a\nb\r\nc\rd";
  TextCursor cursor(text);
  std::vector<std::string_view> words;
  for (; !cursor.atEnd(); cursor.skipLine()) words.push_back(cursor.word());
  EXPECT_EQ(words, (std::vector<std::string_view>{"a", "b", "c", "d"}));
}

TEST(TextCursor, ContinuesALineAfterABackslash) {
  const std::string text = "1 \\\n 2\\\r\n3\\\r4 a\\b\n5";
  TextCursor cursor(text);
  for (const double expected : {1.0, 2.0, 3.0, 4.0}) EXPECT_EQ(cursor.number(), expected);
  EXPECT_EQ(cursor.word(), "a\\b");
  EXPECT_EQ(cursor.word(), "");
  EXPECT_TRUE(cursor.atLineEnd());
}

TEST(TextCursor, ContinuesALineAfterABackslashAndBlanks) {
  const std::string text = "1 \\ \t\n2 \\ x\n\\";
  TextCursor cursor(text);
  EXPECT_EQ(cursor.number(), 1.0);
  EXPECT_EQ(cursor.number(), 2.0);
  EXPECT_EQ(cursor.word(), "\\");
  EXPECT_EQ(cursor.word(), "x");
  EXPECT_EQ(cursor.word(), "");
  cursor.skipSpace();
  EXPECT_EQ(cursor.word(), "\\");
  EXPECT_TRUE(cursor.atEnd());
}

TEST(TextCursor, PassesOverCommentsWhereTheFormatHasThem) {
  const std::string text = "1#2 3\n# 4 \\\n a\"!#5\r\n6 #";
  TextCursor cursor(text, TextCursor::Comments::hash);
  EXPECT_EQ(cursor.number(), 1.0);
  EXPECT_EQ(cursor.word(), "");
  EXPECT_TRUE(cursor.atLineEnd());
  cursor.skipSpace();
  EXPECT_EQ(cursor.word(), "a\"!");
  cursor.skipSpace();
  EXPECT_EQ(cursor.number(), 6.0);
  EXPECT_EQ(cursor.word(), "");
  EXPECT_TRUE(cursor.atEnd());
  EXPECT_EQ(TextCursor("1#2").word(), "1#2");
}

}  // namespace
}  // namespace vdbdither
