#include "io/profile/json_lines.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace vdbdither {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;
using testing::Pair;
using Path = std::vector<std::string>;

TEST(JsonLines, TellTheLineOfEveryKeyAndElement) {
  const JsonLines lines = jsonLines(
      "{\n"
      "  \"a\": 1, \"b\": [\n"
      "    \"x ] \\\" ,\", {\"c\"\n"
      ":\n"
      "null}\n"
      ",\r\n"
      "    -1e3, true\n"
      "  ],\n"
      "  \"\\u0064\": {}, \"e/f\": []}\n");
  EXPECT_EQ(lines.of(Path{}), 1);
  EXPECT_EQ(lines.of(Path{"a"}), 2);
  EXPECT_EQ(lines.of(Path{"b"}), 2);
  EXPECT_EQ(lines.of(Path{"b", "0"}), 3);
  EXPECT_EQ(lines.of(Path{"b", "1"}), 3);
  EXPECT_EQ(lines.of(Path{"b", "1", "c"}), 3);
  EXPECT_EQ(lines.of(Path{"b", "2"}), 7);
  EXPECT_EQ(lines.of(Path{"b", "3"}), 7);
  EXPECT_EQ(lines.of(Path{"d"}), 9);
  EXPECT_EQ(lines.of(Path{"e/f"}), 9);
  EXPECT_THAT(lines.repeated, IsEmpty());
}

TEST(JsonLines, WhatIsNotThereHasTheLineOfWhatWouldHoldIt) {
  const JsonLines lines = jsonLines("\n{\"a\":\n[1,\n{}]}");
  EXPECT_EQ(lines.of(Path{}), 2);
  EXPECT_EQ(lines.of(Path{"b", "c"}), 2);
  EXPECT_EQ(lines.of(Path{"a", "1", "name"}), 4);
  EXPECT_EQ(lines.of(Path{"a", "7"}), 2);
  EXPECT_EQ(jsonLines("\n\n42").of(Path{"a"}), 3);
}

TEST(JsonLines, TellKeysThatAreThereTwice) {
  const JsonLines lines = jsonLines("{\"a\": {\"b\": 1},\n\"c\": {\"b\": 2,\n\"b\": 3}, \"a\": 4}");
  EXPECT_THAT(lines.repeated, ElementsAre(Pair(3, "b"), Pair(3, "a")));
}

}  // namespace
}  // namespace vdbdither
