#include "io/stack/findings.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace vdbdither {
namespace {

using testing::ElementsAre;

TEST(Findings, KeepsTheFirstOfEachKindAndCountsTheRest) {
  Findings findings;
  for (int i = 0; i < 15; ++i) {
    findings.error("a", std::to_string(i));
    if (i < 2) findings.warning("b", std::to_string(i));
  }
  findings.leaveOut("b", Finding::Severity::warning, 7);
  findings.leaveOut("c", Finding::Severity::note, 0);
  std::vector<std::string> kept;
  for (const Finding& finding : findings.kept()) kept.push_back(finding.id + finding.text);
  EXPECT_THAT(kept,
              ElementsAre("a0", "a1", "a2", "a3", "a4", "a5", "a6", "a7", "a8", "a9", "b0", "b1"));
  EXPECT_EQ(findings.leftOut("a"), 5U);
  EXPECT_EQ(findings.leftOut("b"), 7U);
  EXPECT_EQ(findings.leftOut("c"), 0U);
  EXPECT_EQ(findings.errors(), 15U);
  EXPECT_EQ(findings.warnings(), 9U);
  findings.add({"d", Finding::Severity::note, "is small"});
  EXPECT_EQ(findings.kept().size(), 13U);
  EXPECT_EQ(findings.warnings(), 9U);
}

TEST(Findings, TellWhereTheyAre) {
  EXPECT_EQ(textOf({"a-b", Finding::Severity::error, "is wrong; mend it", "x/s1.png", 4, {{5, 6}}}),
            "error: 'x/s1.png', layer 4, column 5, row 6: is wrong; mend it [a-b]");
  EXPECT_EQ(textOf({"a", Finding::Severity::warning, "is odd"}), "warning: is odd [a]");
  EXPECT_EQ(textOf({"a", Finding::Severity::note, "is small"}), "note: is small [a]");
  EXPECT_EQ(textOf({"a", Finding::Severity::warning, "is\nodd\x1b[2J", "\x07"}),
            "warning: '\\x07': is\\nodd\\x1b[2J [a]");
}

TEST(Findings, NumbersAreGrouped) {
  EXPECT_EQ(grouped(0), "0");
  EXPECT_EQ(grouped(999), "999");
  EXPECT_EQ(grouped(1000), "1,000");
  EXPECT_EQ(grouped(1234567), "1,234,567");
  EXPECT_EQ(counted(1, "slice"), "1 slice");
  EXPECT_EQ(counted(2000, "cavity", "cavities"), "2,000 cavities");
}

}  // namespace
}  // namespace vdbdither
