#include "vdbdither/engine/pipeline.h"

#include <algorithm>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/numbered_layers.h"
#include "vdbdither/model/errors.h"

namespace vdbdither {
namespace {

using testing::Contains;
using testing::ElementsAre;
using testing::Not;
using testing::ThrowsMessage;

/// A chain of numbered layers, run; see `test::notes`.
struct Job {
  explicit Job(const std::string& line)
      : pipeline(parseChain(splitWords(line)), test::findNumbered) {
    test::clearNotes();
    pipeline.plan(watcher);
  }

  test::QuietWatcher watcher;
  Pipeline pipeline;
};

std::vector<std::pair<int, int>> keptBy(const std::string& line) {
  Job job(line);
  job.pipeline.run();
  return test::notes().kept;
}

std::vector<std::string> callsOf(const std::string& verb) {
  std::vector<std::string> calls;
  for (const std::string& call : test::notes().calls) {
    if (call.starts_with(verb)) calls.push_back(call);
  }
  return calls;
}

/// What `sum` makes of the numbers from `bottom` to `top` − 1.
std::vector<std::pair<int, int>> sums(ZRange wanted, int bottom, int top, int below, int above) {
  std::vector<std::pair<int, int>> result;
  for (int z = wanted.begin; z < wanted.end; ++z) {
    int sum = 0;
    for (int at = std::max(bottom, z - below); at <= std::min(top - 1, z + above); ++at)
      sum += at + 100;
    result.emplace_back(z, sum);
  }
  return result;
}

TEST(Pipeline, EveryLayerComesOnceInRisingOrderForAnySlabHeight) {
  for (const char* slab : {"8", "16", "40", "all", "auto"}) {
    const std::string line = "numbers --bottom -13 --top 52 ! sum --below 9 --above 11 ! keep";
    EXPECT_EQ(keptBy(line + " --slab " + slab), sums({-13, 52}, -13, 52, 9, 11)) << slab;
  }
}

TEST(Pipeline, SlabsAreCutAtMultiplesOfTheirHeight) {
  keptBy("numbers --bottom -13 --top 52 ! keep --slab 16");
  EXPECT_THAT(callsOf("numbers"), ElementsAre("numbers -13:0", "numbers 0:16", "numbers 16:32",
                                              "numbers 32:48", "numbers 48:52"));
  keptBy("numbers --bottom -13 --top 52 ! keep --slab 16 --layers 30:40");
  EXPECT_THAT(callsOf("numbers"), ElementsAre("numbers 16:32")) << "the same cuts";
}

TEST(Pipeline, OnlyTheWantedLayersReachTheSinkAndNoOthersAreMadeThanTheyNeed) {
  EXPECT_EQ(keptBy("numbers --top 100 ! sum --below 2 --above 2 ! keep --slab 8 --layers 45:47"),
            sums({45, 47}, 0, 100, 2, 2));
  EXPECT_THAT(callsOf("numbers"), ElementsAre("numbers 32:40", "numbers 40:48", "numbers 48:56"));
  EXPECT_THAT(callsOf("sum"), ElementsAre("sum 40:48"));
}

TEST(Pipeline, LayersThatNobodyMakesAreEmpty) {
  const auto kept = keptBy("numbers --bottom 3 --top 11 ! enlarge --by 20 ! keep --slab 8");
  ASSERT_EQ(kept.size(), 48U);
  for (const auto& [z, n] : kept) EXPECT_EQ(n, z >= 3 && z < 11 ? z + 100 : 0) << z;
  EXPECT_EQ(keptBy("numbers --bottom 3 --top 11 ! enlarge --by 20 ! sum --below 30 ! keep").back(),
            std::pair(30, 103 + 104 + 105 + 106 + 107 + 108 + 109 + 110));
}

TEST(Pipeline, AFilterGetsItsInputsOverItsCoreAsFarAsTheyReach) {
  const auto kept =
      keptBy("numbers --bottom -8 --top 24 ! join --bottom 4 --top 40 ! keep --slab 8");
  ASSERT_EQ(kept.size(), 32U);
  for (const auto& [z, n] : kept) EXPECT_EQ(n, z >= 4 ? 2 * z + 1100 : z + 100) << z;
  EXPECT_THAT(callsOf("input read"),
              ElementsAre("input read 4:8", "input read 8:16", "input read 16:24"));
}

TEST(Pipeline, InputsAreReadToTheirEndBeforeAnySinkPublishes) {
  keptBy("numbers ! join --pipe ! keep");
  const auto& calls = test::notes().calls;
  const auto end = std::find(calls.begin(), calls.end(), "input end");
  EXPECT_LT(std::find(calls.begin(), calls.end(), "keep 0:16"), end);
  EXPECT_LT(end, std::find(calls.begin(), calls.end(), "keep finish"));
  EXPECT_EQ(std::count(calls.begin(), calls.end(), "input end"), 1);
}

TEST(Pipeline, AJobThatIsOnlyExplainedReadsItsInputsToTheirEndAndMakesNothing) {
  Job job("numbers ! join --pipe ! keep --explain");
  job.pipeline.readInputsToEnd();
  EXPECT_THAT(test::notes().calls, ElementsAre("input end"));
}

TEST(Pipeline, ASinkInTheMiddleSeesTheSlabsAndTheyPassOn) {
  const auto kept = keptBy("numbers --top 8 ! keep ! sum --above 7 ! keep");
  ASSERT_EQ(kept.size(), 16U);
  EXPECT_EQ(kept.front(), std::pair(0, 100));
  EXPECT_EQ(kept[8], std::pair(0, 828));
  EXPECT_EQ(callsOf("keep finish").size(), 2U);
}

TEST(Pipeline, TellsProgressByLayersAndReportsWhatStagesDid) {
  Job job("numbers --top 40 ! sum ! keep --slab 16 --json --layers 8:40");
  job.pipeline.run();
  EXPECT_EQ(job.watcher.last_progress, "keep 32/32");
  const JobReport report = job.pipeline.report();
  EXPECT_EQ(report.layers, 32);
  EXPECT_EQ(report.box_voxels, 8 * 8 * 32);
  EXPECT_FALSE(report.expected_seconds) << "`sum` does not state its work";
  ASSERT_EQ(report.stages.size(), 3U);
  EXPECT_EQ(report.stages[0].name, "numbers");
  EXPECT_EQ(report.stages[0].active_voxels, 32);
  EXPECT_GT(report.stages[1].bytes, 0);
  EXPECT_DOUBLE_EQ(*report.stages[0].expected_cpu_seconds, 32);
}

TEST(Pipeline, AnErrorNamesItsStageAndNothingIsPublished) {
  Job job("numbers --top 32 ! sum --fail-at 20 ! keep --slab 8");
  EXPECT_THAT([&] { job.pipeline.run(); }, ThrowsMessage<DataError>("sum: layer 20"));
  EXPECT_THAT(test::notes().calls, Contains("keep 8:16"));
  EXPECT_THAT(test::notes().calls, Not(Contains("keep finish")));
}

TEST(Pipeline, AllSinksFinishBeforeTheFirstPublishes) {
  keptBy("numbers --top 8 ! keep --file a ! keep --file b");
  EXPECT_THAT(test::notes().calls, ElementsAre("numbers 0:8", "keep 0:8", "keep 0:8", "keep finish",
                                               "keep finish", "publish b", "publish a"));
}

TEST(Pipeline, ASinkThatFailsToFinishLeavesAllUnpublished) {
  for (const char* line : {"keep --fail-to-finish ! keep", "keep ! keep --fail-to-finish"}) {
    Job job("numbers --top 8 ! " + std::string(line));
    EXPECT_THAT([&] { job.pipeline.run(); }, ThrowsMessage<DataError>("keep: cannot finish"));
    EXPECT_THAT(callsOf("publish"), testing::IsEmpty()) << line;
  }
}

TEST(Pipeline, AFailureToPublishTellsWhatIsPublishedAlready) {
  Job last("numbers --top 8 ! keep --file a ! keep --fail-to-publish");
  EXPECT_THAT([&] { last.pipeline.run(); }, ThrowsMessage<DataError>("keep: cannot publish"));
  Job first("numbers --top 8 ! keep --fail-to-publish ! keep --file a ! keep --file b");
  EXPECT_THAT(
      [&] { first.pipeline.run(); },
      ThrowsMessage<DataError>("keep: cannot publish; of this run there is already 'b', 'a'"));
}

}  // namespace
}  // namespace vdbdither
