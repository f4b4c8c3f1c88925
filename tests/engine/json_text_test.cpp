#include "vdbdither/engine/json_text.h"

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

namespace vdbdither {
namespace {

using nlohmann::ordered_json;

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

}  // namespace
}  // namespace vdbdither
