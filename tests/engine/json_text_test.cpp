#include "vdbdither/engine/json_text.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

namespace vdbdither {
namespace {

using nlohmann::ordered_json;
using testing::StartsWith;

TEST(JsonText, KeepsOrderNumbersAndText) {
  const ordered_json json = {{"b", 1.5}, {"a", {1, nullptr, true}}, {"ü", "部品 \"x\" \\ 🖨"}};
  EXPECT_EQ(jsonText(json), json.dump());
  EXPECT_EQ(jsonText(json, 1), json.dump(1));
}

TEST(JsonText, BytesThatAreNotUtf8BecomeEscapesInStringsAndKeys) {
  const ordered_json json = {{"caf\xe9", {{"path", "caf\xe9.stl"}}}, {"list", {"\xff"}}};
  const ordered_json read = ordered_json::parse(jsonText(json));
  EXPECT_EQ(read["caf\\xe9"]["path"], "caf\\xe9.stl");
  EXPECT_EQ(read["list"][0], "\\xff");
}

TEST(JsonText, CharactersThatSteerATerminalAreEscapedAndReadBack) {
  const std::string text = "\x1b[31m\n\x7f\u009b\u202e\u2028 é";
  const std::string written = jsonText({{"name", text}});
  EXPECT_EQ(written, "{\"name\":\"\\u001b[31m\\n\\u007f\\u009b\\u202e\\u2028 é\"}");
  EXPECT_EQ(ordered_json::parse(written)["name"], text);
}

TEST(JsonText, TextThatIsNoJsonOrNestsTooDeepIsDiscarded) {
  EXPECT_EQ(parsedJson(R"({"a": [1, "]\"["]})")["a"][1], "]\"[");
  EXPECT_TRUE(parsedJson("").is_discarded());
  EXPECT_TRUE(parsedJson("[1,").is_discarded());
  EXPECT_TRUE(parsedJson("\"\xff\"").is_discarded());
  EXPECT_FALSE(parsedJson(std::string(100, '[') + std::string(100, ']')).is_discarded());
  EXPECT_TRUE(parsedJson(std::string(101, '[') + std::string(101, ']')).is_discarded());
  EXPECT_TRUE(parsedJson(std::string(10'000'000, '[')).is_discarded());
  EXPECT_TRUE(parsedJson(std::string_view("1\0]", 3)).is_discarded());
  EXPECT_TRUE(parsedJson(std::string_view("{}\0", 3)).is_discarded());
}

TEST(JsonText, ProblemsHaveTheirLineAndColumn) {
  EXPECT_EQ(jsonProblem("{\"a\": [1, 2]}"), "");
  EXPECT_THAT(jsonProblem("{\n  \"a\": 1,\n  \"b\" 2\n}"),
              StartsWith("line 3, column 7: this is not JSON: syntax error"));
  EXPECT_THAT(jsonProblem("{\"a\": 1,}"), StartsWith("line 1, column 9: this is not JSON: "));
  EXPECT_THAT(jsonProblem("{\n"), StartsWith("line 2, column 1: this is not JSON: "));
  EXPECT_THAT(jsonProblem(""), StartsWith("line 1, column 1: this is not JSON: "));
  EXPECT_THAT(jsonProblem("// a\n{}"), StartsWith("line 1, column 1: this is not JSON: "));
  EXPECT_EQ(jsonProblem(std::string_view("{}\n\0]", 5)),
            "line 2, column 1: this is not JSON: a zero byte");
  EXPECT_EQ(jsonProblem(std::string(101, '[') + std::string(101, ']')),
            "line 1, column 101: the text nests deeper than 100 levels");
}

TEST(JsonText, NumbersBeyondTheRangeOfDoubleAreAProblem) {
  EXPECT_EQ(parsedJson("[1e308]")[0], 1e308);
  for (const char* number : {"1e400", "-1e400", "1e99999"}) {
    const std::string text = "{\n\"a\": [0.1, " + std::string(number) + "]}";
    EXPECT_TRUE(parsedJson(text).is_discarded());
    EXPECT_EQ(jsonProblem(text),
              "line 2, column 12: the number " + std::string(number) + " is too large");
  }
  EXPECT_THAT(jsonProblem(std::string(400, '9')), StartsWith("line 1, column 1: the number 9999"));
  EXPECT_LT(jsonProblem(std::string(400, '9')).size(), 100U);
}

}  // namespace
}  // namespace vdbdither
