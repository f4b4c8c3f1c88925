#include "vdbdither/engine/estimate.h"

#include <gtest/gtest.h>

#include "vdbdither/engine/job_plan.h"
#include "vdbdither/model/layers.h"
#include "vdbdither/model/openvdb.h"

namespace vdbdither {
namespace {

using Kind = StagePlan::Kind;
using openvdb::Coord;

/// A stage over 64 layers whose grids hold 10 leaves in every row.
StagePlan stageWith(Kind kind, const std::vector<std::string>& grids) {
  StagePlan stage;
  stage.kind = kind;
  stage.schema.lattice.box = {Coord(0), Coord(63)};
  stage.schema.footprint = {10, 80, 40};
  for (const std::string& name : grids) stage.schema.grids[name] = openvdb::FloatGrid::create();
  return stage;
}

double leaf() { return leafBytes(openvdb::FloatGrid::create()); }

/// A source of two grids, a filter that reads one, a sink.
JobPlan chain(const Reach& reach) {
  JobPlan plan;
  plan.stages = {stageWith(Kind::source, {"a", "b"}), stageWith(Kind::filter, {"a", "b"}),
                 stageWith(Kind::sink, {"a", "b"})};
  plan.stages[0].handed_on = {"a", "b"};
  plan.stages[1].reads = {{"a", reach}};
  plan.stages[1].handed_on = {"b"};
  plan.stages[2].cores = {0, 64};
  return plan;
}

TEST(CpuSeconds, AddUpByLeavesByLayersAndOnce) {
  const Footprint footprint{10, 80, 40};
  const Work work{
      .us_per_surface_leaf = 1e6, .us_per_held_leaf = 1e5, .us_per_layer = 1e3, .seconds = 7};
  EXPECT_DOUBLE_EQ(*cpuSeconds(work, footprint, 64, 64), 7 + 40 + 8 + 0.064);
  EXPECT_DOUBLE_EQ(*cpuSeconds(work, footprint, 16, 64), 7 + (40 + 8 + 0.064) / 4);
}

TEST(CpuSeconds, AreUnknownWithoutTheLeavesThatTheyNeed) {
  EXPECT_FALSE(cpuSeconds({.us_per_held_leaf = 1}, {}, 8, 64));
  EXPECT_FALSE(cpuSeconds({.us_per_surface_leaf = 1}, {}, 8, 64));
  EXPECT_DOUBLE_EQ(*cpuSeconds({.us_per_layer = 1e6}, {}, 8, 64), 8);
  EXPECT_FALSE(cpuSeconds({.seconds = 1}, {1, 1, 1}, 0, 0)) << "a job without layers";
}

TEST(MemoryBytes, CountASlabOfEveryStageAndWhatOperatorsHold) {
  JobPlan plan = chain(Reach::point());
  // Slabs of 16 layers meet 3 rows: of both grids from the source and in the first window, of one
  // in the last.
  const double slabs = 30 * leaf() * (2 + 2 + 1);
  const double program = memoryBytes(plan, 16) - slabs;
  EXPECT_NEAR(program, 40e6, 1);
  plan.stages[1].memory_bytes = 3e6;
  EXPECT_NEAR(memoryBytes(plan, 16), program + slabs + 3e6, 1);
}

TEST(MemoryBytes, GrowWithTheReachAndOnceMoreIfTheGridIsCopied) {
  const JobPlan point = chain(Reach::point());
  JobPlan reaching = chain(Reach::stencil(8));
  // The window holds 16 layers more of both grids, and the halo of `a` once more.
  const double more = 20 * leaf() * 2 + 30 * leaf();
  EXPECT_NEAR(memoryBytes(reaching, 16) - memoryBytes(point, 16), more, 1);
  // A grid that leaves the filter, too, is copied with its halo: 5 rows in place of 3.
  reaching.stages[1].handed_on = {"a", "b"};
  EXPECT_NEAR(memoryBytes(reaching, 16) - memoryBytes(point, 16), more + 20 * leaf() + 30 * leaf(),
              1);
}

TEST(MemoryBytes, ABarrierHoldsTheWholeVolumeAndNoMoreLeavesThanThereAre) {
  JobPlan plan = chain(Reach::point());
  const double before = memoryBytes(plan, 8);
  plan.stages[2].is_barrier = true;
  // 64 layers meet up to 9 rows of 10 leaves, but there are 80.
  EXPECT_NEAR(memoryBytes(plan, 8) - before, (80 - 20) * leaf(), 1);
}

TEST(MemoryBytes, OfASinkAreThoseOfTheLayersThatItTakes) {
  JobPlan plan = chain(Reach::point());
  plan.stages[2].is_barrier = true;
  const double all = memoryBytes(plan, 8);
  plan.stages[2].cores = {16, 32};
  // 16 layers meet up to 3 rows of 10 leaves.
  EXPECT_NEAR(all - memoryBytes(plan, 8), (80 - 30) * leaf(), 1);
}

TEST(Seconds, AreTheSumOfAllStagesOnSomeThreads) {
  JobPlan plan = chain(Reach::point());
  for (StagePlan& stage : plan.stages) stage.cpu_seconds = 10;
  EXPECT_DOUBLE_EQ(*secondsOf(plan), 30);
  plan.threads = 2;
  EXPECT_GT(*secondsOf(plan), 15);
  EXPECT_LT(*secondsOf(plan), 30);
  plan.stages[1].cpu_seconds.reset();
  EXPECT_FALSE(secondsOf(plan));
}

TEST(FreeMemoryAndDisk, AreMoreThanNothing) {
  EXPECT_GT(freeMemoryBytes(), 1e6);
  EXPECT_GT(freeDiskBytes("/tmp/x.vdb"), 0);
  EXPECT_GT(freeDiskBytes("x.vdb"), 0) << "in the present folder";
}

}  // namespace
}  // namespace vdbdither
