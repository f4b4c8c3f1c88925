#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <openvdb/tools/LevelSetSphere.h>

#include "io/vdb/vdb.h"
#include "tests/support/scratch_folder.h"
#include "vdbdither/engine/operator.h"
#include "vdbdither/engine/registry.h"
#include "vdbdither/model/errors.h"
#include "vdbdither/model/known_grids.h"

namespace vdbdither {
namespace {

using openvdb::FloatGrid;
using testing::AllOf;
using testing::HasSubstr;
using testing::ThrowsMessage;

/// Reads grids from files as other tools write them.
class ReadTest : public testing::Test {
 protected:
  ReadTest() { initializeVdb(); }

  static FloatGrid::Ptr ball() {
    return openvdb::tools::createLevelSetSphere<FloatGrid>(8, {}, 1, 3);
  }
  static FloatGrid::Ptr hollow() {
    const auto grid = ball();
    for (auto value = grid->beginValueOff(); value; ++value) value.setValue(3);
    return grid;
  }

  [[nodiscard]] auto planning(const VdbContents& contents,
                              const std::vector<std::string>& more = {}) const {
    const std::string path = folder_ / "a.vdb";
    writeVdb(path, contents, VdbCodec::mask, path);
    std::vector<std::string> arguments{path};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return [arguments] {
      const auto made = findOperator("read").make();
      Options options;
      made->declare(options);
      options.parse(arguments);
      dynamic_cast<Source&>(*made).plan();
    };
  }

 private:
  test::ScratchFolder folder_;
};

TEST_F(ReadTest, SoundGridsOfOtherToolsAreTaken) {
  EXPECT_NO_THROW(planning({{{"surface", ball()}}, {}})());
  const auto fog = FloatGrid::create(0);
  fog->setGridClass(openvdb::GRID_FOG_VOLUME);
  EXPECT_NO_THROW(planning({{{"density", fog}}, {}})());
}

TEST_F(ReadTest, AGridWithAFaultIsRefusedUnlessItIsNotWanted) {
  const auto bad = ball();
  bad->tree().setValue({0, 0, 7}, std::nanf(""));
  const VdbContents contents{{{"bad", bad}, {"surface", ball()}}, {}};
  EXPECT_THAT(planning(contents),
              ThrowsMessage<DataError>(AllOf(HasSubstr("a.vdb': grid 'bad' holds "),
                                             HasSubstr(" at voxel 0 0 7, which is not a finite"))));
  EXPECT_NO_THROW(planning(contents, {"--grids", "surface"})());
}

TEST_F(ReadTest, ALevelSetThatWouldBeHollowIsRefused) {
  EXPECT_THAT(planning({{{"surface", hollow()}}, {}}),
              ThrowsMessage<DataError>(
                  "grid 'surface' is a level set with its inside at +background, as if it were "
                  "hollow; resample --grid surface fills it if its surface is closed"));
  // What vdbdither makes may be so thin that nothing lies beyond its band.
  EXPECT_NO_THROW(planning({{{"surface", hollow()}}, {{history_key, "mesh2sdf a.stl"}}})());
}

TEST_F(ReadTest, FogThatIsCalledSurfaceIsRefused) {
  const auto fog = FloatGrid::create(0);
  fog->setGridClass(openvdb::GRID_FOG_VOLUME);
  EXPECT_THAT(planning({{{"surface", fog}}, {}}),
              ThrowsMessage<DataError>("grid 'surface' is fog and holds no distances; resample "
                                       "--grid surface makes them"));
}

}  // namespace
}  // namespace vdbdither
