#include "vdbdither/engine/window.h"

#include <map>

#include <gtest/gtest.h>

#include "vdbdither/model/openvdb.h"

namespace vdbdither {
namespace {

using openvdb::Int32Grid;

constexpr ZRange job{-13, 52};

/// A slab whose voxel (0, 0, z) holds z + 100, in a grid `a` and a grid `b`.
Slab numbered(ZRange core) {
  Slab slab{core, core, {}};
  for (const char* name : {"a", "b"}) {
    const auto grid = Int32Grid::create(0);
    for (int z = core.begin; z < core.end; ++z) grid->tree().setValue({0, 0, z}, z + 100);
    slab.grids[name] = grid;
  }
  return slab;
}

std::vector<Window::Task> pushAll(Window& window, int height) {
  std::vector<Window::Task> tasks;
  for (int begin = job.begin; begin < job.end;) {
    const int end = std::min(alignedToLeaves({begin, begin + 1}).begin + height, job.end);
    for (Window::Task& task : window.push(numbered({begin, end}))) tasks.push_back(std::move(task));
    begin = end;
  }
  return tasks;
}

int valueAt(const Grids& grids, const char* name, int z) {
  return openvdb::gridConstPtrCast<Int32Grid>(grids.at(name))->tree().getValue({0, 0, z});
}

TEST(Window, EveryCoreComesOnceInRisingOrderWithItsWholeHalo) {
  for (const int height : {8, 16, 64}) {
    for (const int radius : {0, 1, 9, 30}) {
      Window window({{"a", {radius, radius + 2}}}, job, job, {"a", "b"});
      int next = job.begin;
      for (const Window::Task& task : pushAll(window, height)) {
        EXPECT_EQ(task.input.core.begin, next);
        next = task.input.core.end;
        EXPECT_EQ(task.input.valid,
                  intersection({task.input.core.begin - radius, next + radius + 2}, job));
        for (int z = task.input.valid.begin; z < task.input.valid.end; ++z) {
          EXPECT_EQ(valueAt(task.input.grids, "a", z), z + 100);
        }
      }
      EXPECT_EQ(next, job.end) << height << " " << radius;
    }
  }
}

TEST(Window, TheFilterGetsOnlyWhatItReadsAndTheRestPasses) {
  Window window({{"a", Reach::stencil(1)}}, job, job, {"a", "b"});
  for (const Window::Task& task : pushAll(window, 8)) {
    EXPECT_FALSE(task.input.grids.contains("b"));
    EXPECT_EQ(valueAt(task.passing.grids, "b", task.passing.core.begin),
              task.passing.core.begin + 100);
    EXPECT_EQ(valueAt(task.passing.grids, "a", task.passing.core.end), 0);
  }
}

TEST(Window, AGridThatPassesNoFurtherGrowsByItsHaloUncopied) {
  for (const int height : {16, 24, 64}) {
    for (const Reach reach : {Reach{1, 0}, Reach{0, 2}, Reach{9, 9}, Reach{30, 1}}) {
      Window window({{"a", reach}}, job, job, {"b"});
      std::size_t uncopied = 0;
      std::map<int, const openvdb::GridBase*> came;
      for (int begin = job.begin; begin < job.end;) {
        const int end = std::min(alignedToLeaves({begin, begin + 1}).begin + height, job.end);
        Slab slab = numbered({begin, end});
        came[begin] = slab.grids.at("a").get();
        for (const Window::Task& task : window.push(std::move(slab))) {
          for (int z = task.input.valid.begin; z < task.input.valid.end; ++z)
            EXPECT_EQ(valueAt(task.input.grids, "a", z), z + 100) << height;
          EXPECT_EQ(valueAt(task.input.grids, "a", task.input.valid.end + 16), 0);
          uncopied +=
              static_cast<int>(task.input.grids.at("a").get() == came.at(task.input.core.begin));
          EXPECT_FALSE(task.passing.grids.contains("a"));
        }
        begin = end;
      }
      if (reach.below <= height - leaf_layers) {
        EXPECT_EQ(uncopied, came.size()) << height << " " << reach.below;
      }
    }
  }
}

TEST(Window, AGridThatSomebodyHoldsIsNotChanged) {
  Window window({{"a", Reach::stencil(2)}}, job, job, {});
  const Slab low = numbered({-13, 8});
  const Slab high = numbered({8, 24});
  EXPECT_TRUE(window.push(low).empty());
  const std::vector<Window::Task> tasks = window.push(high);
  ASSERT_EQ(tasks.size(), 1U);
  EXPECT_EQ(valueAt(tasks[0].input.grids, "a", 9), 109);
  EXPECT_EQ(valueAt(low.grids, "a", 9), 0);
}

TEST(Window, WhatStandsOutsideASlabIsCutOff) {
  Window window({{"a", Reach::stencil(2)}}, job, job, {});
  Slab low = numbered({-13, 24});
  low.core = low.valid = {-13, 8};
  window.push(std::move(low));
  Slab high = numbered({-13, 24});
  high.core = high.valid = {8, 24};
  const auto grid = Int32Grid::create(0);
  grid->tree().setValue({0, 0, 9}, 5);
  high.grids["a"] = grid;
  const std::vector<Window::Task> tasks = window.push(std::move(high));
  ASSERT_EQ(tasks.size(), 1U);
  EXPECT_EQ(valueAt(tasks[0].input.grids, "a", 8), 0);
  EXPECT_EQ(valueAt(tasks[0].input.grids, "a", 9), 5);
}

TEST(Window, HandsOutOnlyTheCoresAskedFor) {
  Window window({{"a", Reach::stencil(3)}}, job, {0, 16}, {"a", "b"});
  const std::vector<Window::Task> tasks = pushAll(window, 8);
  ASSERT_EQ(tasks.size(), 2U);
  EXPECT_EQ(tasks[0].input.core, (ZRange{0, 8}));
  EXPECT_EQ(tasks[1].input.core, (ZRange{8, 16}));
  EXPECT_EQ(valueAt(tasks[1].input.grids, "a", 18), 118);
}

TEST(Window, ABarrierGetsAllLayersAtOnce) {
  Window window({{"a", Reach::everything()}}, job, job, {"a", "b"});
  const std::vector<Window::Task> tasks = pushAll(window, 8);
  ASSERT_EQ(tasks.size(), 1U);
  EXPECT_EQ(tasks[0].input.core, job);
  EXPECT_EQ(valueAt(tasks[0].input.grids, "a", -13), 87);
  EXPECT_EQ(valueAt(tasks[0].input.grids, "a", 51), 151);
}

TEST(Window, AGridThatIsReadAtItsPointIsNotCopied) {
  Window window({{"a", Reach::point()}}, job, job, {"a", "b"});
  const Slab slab = numbered({-13, -8});
  const std::vector<Window::Task> tasks = window.push(slab);
  ASSERT_EQ(tasks.size(), 1U);
  EXPECT_EQ(tasks[0].input.grids.at("a"), slab.grids.at("a"));
}

}  // namespace
}  // namespace vdbdither
