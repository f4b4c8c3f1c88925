#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "io/image/exr.h"
#include "tests/support/contract.h"
#include "tests/support/filters.h"
#include "tests/support/scratch_folder.h"
#include "tests/support/volumes.h"
#include "vdbdither/model/errors.h"

namespace vdbdither {
namespace {

using openvdb::FloatGrid;
using openvdb::Vec3d;
using testing::HasSubstr;
using testing::ThrowsMessage;

const Lattice lattice = test::latticeAround({0.042, 0.084, 0.022}, Vec3d(0.6), 0.3);

Schema ballWithBand(double band_mm) { return test::ballWithBand(lattice, 0.5, band_mm); }

auto planning(const Schema& schema, const std::vector<std::string>& arguments) {
  return test::planning("offset", schema, arguments);
}

class OffsetMap : public testing::Test {
 protected:
  /// Heights of 0 … 1 in four by three pixels.
  std::string map() {
    const std::vector<ExrChannel> channels{{"Y", false}};
    const auto bytes = encodeExr(4, 3, ExrFormat{}, channels,
                                 [](std::uint32_t row, std::size_t, std::span<float> values) {
                                   for (std::size_t x = 0; x < 4; ++x)
                                     values[x] = static_cast<float>(4 * row + x) / 11;
                                 });
    const std::filesystem::path path = folder / "map.exr";
    std::ofstream(path, std::ios::binary)
        .write(reinterpret_cast<const char*>(bytes.data()),
               static_cast<std::streamsize>(bytes.size()));
    return path.string();
  }
  test::ScratchFolder folder;
};

TEST(Offset, SaysWhichBandItNeeds) {
  for (const char* by : {"0.2mm", "-0.2mm"}) {
    EXPECT_THAT(planning(ballWithBand(0.29), {"--by", by}),
                ThrowsMessage<DataError>("grid 'surface' holds distances up to 0.29 mm, and "
                                         "offsets up to 0.2 mm need 0.2965 mm: "
                                         "widen --band of mesh2sdf or resample by 0.007 mm"));
  }
  EXPECT_NO_THROW(planning(ballWithBand(0.297), {"--by", "0.2mm"})());
}

TEST_F(OffsetMap, CountsItsHeightsIntoTheBand) {
  EXPECT_THAT(
      planning(ballWithBand(0.29), {"--by", "-0.05mm", "--map", map(), "--height", "0.25mm"}),
      ThrowsMessage<DataError>(HasSubstr("offsets up to 0.2 mm")));
  EXPECT_NO_THROW(
      planning(ballWithBand(0.29), {"--by", "-0.1mm", "--map", map(), "--height", "0.2mm"})());
}

TEST_F(OffsetMap, KeepsWhatAFilterPromisesInEveryWayOfReading) {
  const Schema schema = [] {
    Schema in = ballWithBand(0.3);
    const auto heights = FloatGrid::create(0.02F);
    heights->fill(openvdb::CoordBBox(openvdb::Coord(-9), openvdb::Coord(2, 30, 14)), -0.05F, true);
    in.grids["heights"] = heights;
    return in;
  }();
  const Schema empty = [&] {
    Schema in = schema;
    for (auto& [name, grid] : in.grids) grid = grid->copyGridWithNewTree();
    return in;
  }();
  for (const char* at : {"closest", "foot"}) {
    for (const std::vector<std::string>& arguments : std::vector<std::vector<std::string>>{
             {"--map", map(), "--height", "0.1", "--along", "y", "--at", at},
             {"--grid", "heights", "--most", "0.1", "--at", at}}) {
      const auto filter = test::filterCalled("offset", arguments);
      filter->plan(schema);
      EXPECT_EQ(test::firstBreach(*filter, empty, schema.grids, 8), "") << at;
    }
  }
}

TEST_F(OffsetMap, RefusesHalfAnOrder) {
  const Schema schema = ballWithBand(0.4);
  EXPECT_THAT(planning(schema, {}),
              ThrowsMessage<UsageError>("give an offset: --by, --map or --grid"));
  EXPECT_THAT(planning(schema, {"--map", map()}),
              ThrowsMessage<UsageError>("--map needs --height, which must not be 0 mm"));
  EXPECT_THAT(planning(schema, {"--grid", "heights"}),
              ThrowsMessage<UsageError>("--grid and --most go together; give both"));
  EXPECT_THAT(planning(schema, {"--by", "0.1", "--most", "0.1"}),
              ThrowsMessage<UsageError>("--grid and --most go together; give both"));
  EXPECT_THAT(planning(schema, {"--grid", "heights", "--most", "0.1"}),
              ThrowsMessage<DataError>("no grid 'heights'; there is 'surface'"));
  EXPECT_THAT(planning(schema, {"--map", "nowhere.png", "--height", "1"}),
              ThrowsMessage<UsageError>("--map: no such file 'nowhere.png'"));
  EXPECT_THAT(planning(schema, {"--by", "0.1", "--pixel", "-1"}),
              ThrowsMessage<UsageError>("--pixel: '-1' is not accepted; the length must be "
                                        "greater than 0 mm, up to 1000000 mm"));
}

}  // namespace
}  // namespace vdbdither
