#include "vdbdither/model/printable.h"

#include <gtest/gtest.h>

namespace vdbdither {
namespace {

TEST(Printable, TextWithoutControlCharactersStays) {
  for (const std::string text : {"", "part.stl", "Stück 3 µm", "部品", "🖨", "a\\b 'c'"}) {
    EXPECT_TRUE(isPrintable(text)) << text;
    EXPECT_EQ(printable(text), text);
    EXPECT_EQ(printableLines(text), text);
    EXPECT_EQ(validUtf8(text), text);
  }
}

TEST(Printable, ControlCharactersBecomeEscapesOnOneLine) {
  EXPECT_EQ(printable("\x1b[31mred\x07"), "\\x1b[31mred\\x07");
  EXPECT_EQ(printable("a\nb\tc\rd"), "a\\nb\\tc\\rd");
  EXPECT_EQ(printable("\x7f"), "\\x7f");
  EXPECT_EQ(printable(std::string_view("\0", 1)), "\\x00");
}

TEST(Printable, CharactersThatSteerATerminalOrTurnTextBecomeEscapes) {
  EXPECT_EQ(printable("\u009b31m"), "\\xc2\\x9b31m");
  EXPECT_EQ(printable("\u202egnp.exe"), "\\xe2\\x80\\xaegnp.exe");
  EXPECT_EQ(printable("a\u2028b"), "a\\xe2\\x80\\xa8b");
  EXPECT_FALSE(isPrintable("\u2066"));
  EXPECT_TRUE(isPrintable("\u00a0"));
}

TEST(Printable, BytesThatAreNotUtf8BecomeEscapes) {
  EXPECT_EQ(printable("caf\xe9.stl"), "caf\\xe9.stl");
  // Overlong, a surrogate, beyond Unicode, cut short, a continuation alone.
  EXPECT_EQ(printable("\xc0\xaf"), "\\xc0\\xaf");
  EXPECT_EQ(printable("\xed\xa0\x80"), "\\xed\\xa0\\x80");
  EXPECT_EQ(printable("\xf4\x90\x80\x80"), "\\xf4\\x90\\x80\\x80");
  EXPECT_EQ(printable("\xe2\x82"), "\\xe2\\x82");
  EXPECT_EQ(printable("\x80"), "\\x80");
  EXPECT_EQ(validUtf8("\n\x1b\xff"), "\n\x1b\\xff");
}

TEST(Printable, LinesAndTabsOfATextOfSeveralLinesStay) {
  EXPECT_EQ(printableLines("a\tb\nc\x1b\r\n"), "a\tb\nc\\x1b\\x0d\n");
}

TEST(Printable, AShortenedTextStatesItsLengthAndCutsNoCharacter) {
  EXPECT_EQ(shortened("abc", 3), "abc");
  EXPECT_EQ(shortened("abcdef", 3), "abc... (6 bytes)");
  EXPECT_EQ(shortened("aµµ", 2), "a... (5 bytes)");
}

}  // namespace
}  // namespace vdbdither
