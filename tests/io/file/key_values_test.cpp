#include "io/file/key_values.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "vdbdither/model/errors.h"

namespace vdbdither {
namespace {

using testing::Optional;

KeyValues valuesOf(std::string_view text) {
  return {{reinterpret_cast<const std::uint8_t*>(text.data()), text.size()}, "'a.ini'"};
}

template <typename Work>
std::string refusalOf(const Work& work) {
  try {
    work();
  } catch (const DataError& error) {
    return error.what();
  }
  return "";
}

TEST(KeyValues, PassesOverBlankLinesCommentsSectionsAndWhiteSpace) {
  const KeyValues values =
      valuesOf("# a = 1\n; b = 2\n[c]\n\n  width\t=  1.5 \r\nnotes = x = y\nempty =\nlast=3");
  EXPECT_EQ(values.find("a"), std::nullopt);
  EXPECT_EQ(values.find("b"), std::nullopt);
  EXPECT_EQ(values.number("width", 0, 2), 1.5);
  EXPECT_THAT(values.find("notes"), Optional(std::string("x = y")));
  EXPECT_THAT(values.find("empty"), Optional(std::string()));
  EXPECT_EQ(values.integer("last", 0, 3), 3);
}

TEST(KeyValues, RefusesWhatIsNoKeyWithAValue) {
  EXPECT_EQ(refusalOf([] { valuesOf("a = 1\nnonsense\n"); }),
            "'a.ini', line 2: is not 'key = value'");
  EXPECT_EQ(refusalOf([] { valuesOf("= 1"); }), "'a.ini', line 1: is not 'key = value'");
  EXPECT_EQ(refusalOf([] { valuesOf("a = 1\n\na = 2"); }), "'a.ini', line 3: 'a' is there twice");
}

TEST(KeyValues, RefusesValuesThatAreMissingOrOutOfRange) {
  const KeyValues values = valuesOf("word = x\nlarge = 11\nhalf = 0.5\nnan = nan\ntail = 1 mm");
  EXPECT_EQ(refusalOf([&] { static_cast<void>(values.text("none")); }),
            "'a.ini': 'none' is missing");
  for (const char* key : {"word", "large", "nan", "tail"}) {
    EXPECT_EQ(refusalOf([&] { static_cast<void>(values.number(key, 1, 10)); }),
              "'a.ini': '" + std::string(key) + "' must be a number from 1 to 10, not '" +
                  *values.find(key) + "'");
  }
  EXPECT_EQ(refusalOf([&] { static_cast<void>(values.integer("half", 0, 10)); }),
            "'a.ini': 'half' must be a whole number");
}

}  // namespace
}  // namespace vdbdither
