#include "vdbdither/engine/chain.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "vdbdither/model/errors.h"

namespace vdbdither {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;
using Words = std::vector<std::string>;

std::string refusal(const Words& words) {
  try {
    parseChain(words);
  } catch (const UsageError& error) {
    return error.what();
  }
  return "";
}

TEST(Chain, ExclamationMarksPartTheSteps) {
  const std::vector<Step> steps =
      parseChain(Words{"mesh2sdf", "a.stl", "!", "dither", "!", "write", "-"});
  ASSERT_EQ(steps.size(), 3U);
  EXPECT_EQ(steps[0].verb, "mesh2sdf");
  EXPECT_THAT(steps[0].arguments, ElementsAre("a.stl"));
  EXPECT_THAT(steps[1].arguments, IsEmpty());
  EXPECT_THAT(steps[2].arguments, ElementsAre("-"));
}

TEST(Chain, EmptyStepsAreRefused) {
  EXPECT_EQ(refusal({}), "the chain is empty");
  EXPECT_EQ(refusal({"!", "dither"}), "there is no operator before '!'");
  EXPECT_EQ(refusal({"dither", "|", "|", "normals"}), "there is no operator before '|'");
  EXPECT_EQ(refusal({"dither", "!"}), "there is no operator after the last '!' or '|'");
}

TEST(Chain, WordsAreCutAsAShellWould) {
  EXPECT_THAT(splitWords(R"(mesh2sdf 'my part.stl'|dither --mask "a \"b\".vdb" | write x\ y.vdb)"),
              ElementsAre("mesh2sdf", "my part.stl", "|", "dither", "--mask", R"(a "b".vdb)", "|",
                          "write", "x y.vdb"));
  EXPECT_THAT(splitWords("  "), IsEmpty());
  EXPECT_THAT(splitWords("a '' b"), ElementsAre("a", "", "b"));
  EXPECT_THROW(splitWords("mesh2sdf 'part.stl"), UsageError);
}

TEST(Chain, EscapesBelongToDollarQuotes) {
  EXPECT_THAT(splitWords(R"(a$'\n\t\r\x41\'\\'b '\n' $x)"),
              ElementsAre("a\n\t\rA'\\b", R"(\n)", "$x"));
  EXPECT_THROW(splitWords(R"($'a\')"), UsageError);
}

TEST(Chain, ASingleHashBeginsAComment) {
  EXPECT_THAT(splitWords("dither --at foot # vdbdither 0.1 | x\n! write a.vdb"),
              ElementsAre("dither", "--at", "foot", "!", "write", "a.vdb"));
  EXPECT_THAT(splitWords("--background #ff0000 a#b '#' #"),
              ElementsAre("--background", "#ff0000", "a#b", "#"));
}

}  // namespace
}  // namespace vdbdither
