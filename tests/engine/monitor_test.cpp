#include "vdbdither/engine/monitor.h"

#include <new>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/numbered_layers.h"

namespace vdbdither {
namespace {

using testing::ElementsAre;
using testing::Pair;
using testing::ThrowsMessage;

TEST(CallNamed, ErrorsBeginWithTheVerbAndKeepTheirKind) {
  const auto throwing = [](auto error) {
    return [error] { callNamed("grow", [&] { throw error; }); };
  };
  EXPECT_THAT(throwing(UsageError("no")), ThrowsMessage<UsageError>("grow: no"));
  EXPECT_THAT(throwing(DataError("bad")), ThrowsMessage<DataError>("grow: bad"));
  EXPECT_THAT(
      throwing(std::runtime_error("odd")),
      ThrowsMessage<DataError>("grow: failed in a way that is not foreseen, which is a fault "
                               "of the program; report the command line and the input"));
  EXPECT_THAT(
      throwing(std::bad_alloc()),
      ThrowsMessage<DataError>("grow: out of memory; try a smaller --slab or fewer layers"));
  EXPECT_THROW(throwing(Interrupted(2))(), Interrupted);
  EXPECT_EQ(callNamed("grow", [] { return 7; }), 7);
}

TEST(Monitor, PassesMessagesOnWithTheVerbAndKeepsCounts) {
  test::QuietWatcher watcher;
  Monitor monitor("grow");
  monitor.attach(watcher);
  monitor.expectLayers(40);
  monitor.layersDone(8);
  monitor.warn("thin");
  monitor.count("voxels", 3);
  monitor.progress(0.5);
  monitor.print("done\n");
  EXPECT_THAT(watcher.warnings, ElementsAre("grow: thin"));
  EXPECT_EQ(watcher.last_progress, "grow 8/40");
  EXPECT_EQ(watcher.printed, "done\n");
  EXPECT_THAT(monitor.report().counts, ElementsAre(Pair("voxels", 3)));
}

TEST(Monitor, AddsUpTheTimeOfItsCalls) {
  Monitor monitor("grow");
  EXPECT_EQ(monitor.timed([] { return 1; }), 1);
  const double seconds = monitor.report().seconds;
  EXPECT_GT(seconds, 0);
  EXPECT_GT(monitor.report().peak_memory_bytes, 1e5);
  EXPECT_THROW(monitor.timed([] { throw DataError("bad"); }), DataError);
  EXPECT_GT(monitor.report().seconds, seconds) << "a call that fails counts, too";
}

}  // namespace
}  // namespace vdbdither
