#include "io/stack/canonical_json.h"

#include <gtest/gtest.h>

namespace vdbdither {
namespace {

std::string canonical(const std::string& text, std::string_view omitted = {}) {
  std::string result;
  writeCanonically(
      nlohmann::ordered_json::parse(text), [&](std::string_view piece) { result += piece; },
      omitted);
  return result;
}

// The examples of RFC 8785.

TEST(CanonicalJson, HasOneSpelling) {
  EXPECT_EQ(canonical(R"({
    "numbers": [333333333.33333329, 1E30, 4.50, 2e-3, 0.000000000000000000000000001],
    "string": "\u20ac$\u000F\u000aA'\u0042\u0022\u005c\\\"\/",
    "literals": [null, true, false]})"),
            R"({"literals":[null,true,false],)"
            R"("numbers":[333333333.3333333,1e+30,4.5,0.002,1e-27],)"
            R"("string":"€$\u000f\nA'B\"\\\\\"/"})");
}

TEST(CanonicalJson, SortsKeysByTheirUnitsInUtf16) {
  EXPECT_EQ(canonical(R"({"\u20ac": 1, "\r": 2, "\ufb33": 3, "1": 4, "\ud83d\ude00": 5,
                          "\u0080": 6, "\u00f6": 7})"),
            "{\"\\r\":2,\"1\":4,\"\xc2\x80\":6,\"ö\":7,\"€\":1,\"😀\":5,\"\xef\xac\xb3\":3}");
}

TEST(CanonicalJson, SpellsNumbersAsEcmaScriptDoes) {
  const std::vector<std::pair<std::string, std::string>> spellings{
      {"-0.0", "0"},
      {"-0", "0"},
      {"1.0", "1"},
      {"-12.50", "-12.5"},
      {"100000", "100000"},
      {"1e5", "100000"},
      {"5e-324", "5e-324"},
      {"1.7976931348623157e308", "1.7976931348623157e+308"},
      {"9007199254740992", "9007199254740992"},
      {"295147905179352830000", "295147905179352830000"},
      {"999999999999999900000", "999999999999999900000"},
      {"1e21", "1e+21"},
      {"9.999999999999997e22", "9.999999999999997e+22"},
      {"0.000001", "0.000001"},
      {"0.0000012", "0.0000012"},
      {"0.0000001", "1e-7"},
      {"-0.0000033333333333333333", "-0.0000033333333333333333"},
      {"1424953923781206.2", "1424953923781206.2"}};
  for (const auto& [given, expected] : spellings)
    EXPECT_EQ(canonical("[" + given + "]"), "[" + expected + "]") << given;
}

TEST(CanonicalJson, OmitsAKeyOfTheOutermostObjectOnly) {
  EXPECT_EQ(canonical(R"({"b": {"a": 1}, "a": 2})", "a"), R"({"b":{"a":1}})");
}

}  // namespace
}  // namespace vdbdither
