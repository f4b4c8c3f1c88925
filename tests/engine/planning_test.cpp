#include "vdbdither/engine/planning.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/numbered_layers.h"
#include "vdbdither/engine/version.h"
#include "vdbdither/model/errors.h"

namespace vdbdither {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::ThrowsMessage;

/// The plan of a chain of numbered layers, as it is written on a command line.
JobPlan planOf(const std::string& line) {
  const std::vector<std::string> words = splitWords(line);
  const Chain chain(parseChain(words), test::findNumbered);
  test::QuietWatcher watcher;
  for (const auto& stage : chain.stages()) stage->monitor().attach(watcher);
  return planJob(chain.stages(), chain.options());
}

auto planning(const std::string& line) {
  return [line] { planOf(line); };
}

TEST(Planning, EachStageGivesTheLayersThatTheStagesBehindItReach) {
  const JobPlan plan = planOf("numbers --top 200 ! sum --below 3 --above 20 ! keep --layers 80:90");
  EXPECT_EQ(plan.layers, (ZRange{80, 90}));
  EXPECT_EQ(plan.stages[2].cores, (ZRange{80, 90}));
  EXPECT_EQ(plan.stages[1].cores, (ZRange{80, 96})) << "whole leaves";
  EXPECT_EQ(plan.stages[0].cores, (ZRange{72, 120}));
  EXPECT_EQ(plan.stages[1].incoming, plan.stages[0].cores);
  EXPECT_EQ(plan.stages[1].window, plan.stages[0].cores);
}

TEST(Planning, LayersAreCutAtTheBox) {
  const JobPlan plan = planOf("numbers --bottom -5 --top 21 ! sum --below 30 --above 30 ! keep");
  EXPECT_EQ(plan.layers, (ZRange{-5, 21}));
  EXPECT_EQ(plan.stages[0].cores, (ZRange{-5, 21}));
}

TEST(Planning, AFilterThatEnlargesTheBoxGetsEmptyLayersInItsWindow) {
  const JobPlan plan = planOf("numbers --bottom 4 --top 20 ! enlarge --by 10 ! keep");
  EXPECT_EQ(plan.layers, (ZRange{-6, 30}));
  EXPECT_EQ(plan.stages[1].cores, (ZRange{-6, 30}));
  EXPECT_EQ(plan.stages[1].incoming, (ZRange{4, 20}));
  EXPECT_EQ(plan.stages[1].window, (ZRange{-6, 30}));
}

TEST(Planning, AStageHandsOnWhatALaterOneReads) {
  const JobPlan plan = planOf("numbers ! enlarge ! keep");
  EXPECT_THAT(plan.stages[0].handed_on, ElementsAre("n"));
  EXPECT_THAT(plan.stages[1].handed_on, ElementsAre("n")) << "nobody reads `seen`";
  EXPECT_TRUE(plan.stages[2].handed_on.empty());
  const JobPlan archived = planOf("numbers ! enlarge ! write nowhere.vdb ! keep");
  EXPECT_THAT(archived.stages[1].handed_on, ElementsAre("n", "seen"));
}

TEST(Planning, APieceIsPlannedAsARunOfItsLayers) {
  const std::string chain = "numbers --top 200 ! sum --below 3 --above 20 ! keep --memory 4GiB";
  RunOptions options;
  options.memory = "4GiB";
  const JobPlan piece = planPiece(planOf(chain), {80, 90}, options);
  const JobPlan run = planOf(chain + " --layers 80:90");
  EXPECT_EQ(toJson(piece), toJson(run));
  EXPECT_NE(toJson(piece), toJson(planOf(chain)));
  EXPECT_EQ(piece.stages[1].window, run.stages[1].window);
  EXPECT_LT(piece.memory_bytes, planOf(chain + " --slab all").memory_bytes);
}

TEST(Planning, InputsAreDeclaredAndTheirMemoryCounts) {
  const JobPlan plan = planOf("numbers ! join --top 40 --pipe ! keep");
  ASSERT_EQ(plan.stages[1].inputs.size(), 1U);
  const InputPlan& input = plan.stages[1].inputs[0];
  EXPECT_EQ(input.path, "second.vdb");
  EXPECT_TRUE(input.is_pipe);
  EXPECT_EQ(input.layers, (ZRange{0, 40}));
  EXPECT_EQ(plan.stages[1].memory_bytes, 6e6);
  EXPECT_TRUE(plan.stages[0].inputs.empty());
}

TEST(Planning, SlabsAreAsTallAsMemoryAllows) {
  const std::string line = "numbers --top 900 ! keep --explain";
  EXPECT_EQ(planOf(line).slab_layers, 128);
  EXPECT_EQ(planOf(line + " --memory 1MiB").slab_layers, 8);
  EXPECT_EQ(planOf(line + " --slab 24").slab_layers, 24);
  EXPECT_EQ(planOf(line + " --slab all").slab_layers, 904);
}

TEST(Planning, TallSlabsAreForJobsOfLittleMemory) {
  std::string joins;
  for (int i = 0; i < 100; ++i) joins += " ! join --top 40 --pipe";  // of 6 MB each
  EXPECT_EQ(planOf("numbers --top 900" + joins + " ! keep --explain --memory 4GiB").slab_layers,
            64);
}

TEST(Planning, TimeIsKnownIfThatOfEveryStageIs) {
  const JobPlan plan = planOf("numbers --top 16 ! keep --threads 1");
  EXPECT_DOUBLE_EQ(*plan.stages[0].cpu_seconds, 16);
  EXPECT_DOUBLE_EQ(*plan.stages[1].cpu_seconds, 1 + 20e-6);
  EXPECT_DOUBLE_EQ(*plan.seconds, 17 + 20e-6);
  const JobPlan some = planOf("numbers --top 16 ! keep --threads 1 --layers 0:8");
  EXPECT_DOUBLE_EQ(*some.stages[0].cpu_seconds, 8);
  EXPECT_FALSE(planOf("numbers ! sum ! keep").seconds);
}

TEST(Planning, OutputsAreThoseOfTheWantedLayers) {
  const JobPlan plan = planOf("numbers --top 16 ! keep --layers 0:4");
  EXPECT_EQ(plan.stages[1].output.path, "kept.txt");
  EXPECT_DOUBLE_EQ(plan.stages[1].output.bytes, 250);
  EXPECT_GT(plan.stages[1].free_disk_bytes, 0);
}

TEST(Planning, TheHistoryHasALineForEverySourceAndFilter) {
  const JobPlan plan = planOf("numbers --top 8 ! enlarge --by 2 ! keep");
  const std::string made_by = std::string(" # vdbdither ") + version;
  EXPECT_EQ(plan.stages.back().schema.metadata.at("vdbdither:history"),
            "numbers --bottom 0 --top 8" + made_by + "\nenlarge --by 2" + made_by);
  EXPECT_EQ(plan.stages[0].arguments, "--bottom 0 --top 8");
}

TEST(Planning, RefusesWhatCannotBe) {
  EXPECT_THAT(planning("numbers ! keep --layers 4:17"),
              ThrowsMessage<UsageError>("--layers: '4:17' is not A:B with 0 <= A < B <= 16"));
  EXPECT_THAT(planning("numbers ! keep --slab 12"),
              ThrowsMessage<UsageError>("keep: --slab: '12' is not accepted; the value must be a "
                                        "multiple of 8 up to 1048576, auto or all"));
  EXPECT_THAT(
      planning("numbers ! write nowhere.vdb --stream"),
      ThrowsMessage<UsageError>("write: needs the whole volume at once, which --stream forbids"));
  EXPECT_THAT(planning("numbers ! keep --memory 1MiB"),
              ThrowsMessage<DataError>(HasSubstr("the job needs about ")));
  EXPECT_THAT(planning("numbers ! normals ! keep"),
              ThrowsMessage<DataError>("normals: no grid 'surface'; there is 'n'"));
}

}  // namespace
}  // namespace vdbdither
