#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "io/profile/printer_profile.h"
#include "tests/support/contract.h"
#include "tests/support/filters.h"
#include "vdbdither/model/errors.h"

namespace vdbdither {
namespace {

using openvdb::FloatGrid;
using openvdb::Vec3d;
using testing::HasSubstr;
using testing::ThrowsMessage;

const Vec3d pitch_mm(0.042, 0.084, 0.022);

/// A thin bar in a band of `band_mm`.
Schema bar(double band_mm = 0.1) {
  const Lattice lattice = test::latticeAround(pitch_mm, Vec3d(0.3, 0.3, 0.6), 0.1);
  return test::schemaOf(
      lattice,
      {{"surface", test::sampled(test::box(Vec3d(0.01), Vec3d(0.06, 0.2, 0.5), Vec3d(10, 20, 30)),
                                 lattice, band_mm)}});
}

int reachOf(const std::vector<std::string>& arguments, const Schema& schema) {
  const auto filter = test::filterCalled("compensate", arguments);
  filter->plan(schema);
  return filter->reads().at(0).reach.above;
}

TEST(Compensate, KeepsWhatAFilterPromises) {
  const Schema in = bar();
  for (const char* steps : {"1", "2"}) {
    const auto filter = test::filterCalled("compensate", {"--steps", steps});
    filter->plan(in);
    for (const int height : {8, 24})
      EXPECT_EQ(test::firstBreach(*filter, in, in.grids, height), "") << steps << ", " << height;
  }
}

TEST(Compensate, ThickensAThinBarWithinTheSameBand) {
  const Schema in = bar();
  const auto filter = test::filterCalled("compensate");
  const auto before = openvdb::gridConstPtrCast<FloatGrid>(in.grids.at("surface"));
  const auto after =
      openvdb::gridConstPtrCast<FloatGrid>(test::runWhole(*filter, in).at("surface"));
  const auto voxels = [&](const FloatGrid& grid) {
    int inside = 0;
    for (const openvdb::Coord& ijk : in.lattice.box) inside += grid.tree().getValue(ijk) < 0;
    return inside;
  };
  EXPECT_GT(voxels(*after), 1.1 * voxels(*before));
  EXPECT_EQ(after->background(), before->background());
  EXPECT_EQ(after->getGridClass(), openvdb::GRID_LEVEL_SET);
}

TEST(Compensate, ErasesTheGridsThatDescribePointsOfTheSurface) {
  Schema in = bar();
  for (const char* name : {"N", "closest", "part"}) in.grids[name] = in.grids.at("surface");
  const Schema out = test::filterCalled("compensate")->plan(in);
  EXPECT_FALSE(out.grids.contains("N"));
  EXPECT_FALSE(out.grids.contains("closest"));
  EXPECT_TRUE(out.grids.contains("part"));
}

TEST(Compensate, TheSpreadComesFromTheCommandLineThePrinterOrIsFiftyMicrometres) {
  Schema in = bar();
  EXPECT_EQ(reachOf({}, in), reachOf({"--spread", "50um"}, in));
  EXPECT_LT(reachOf({"--spread", "0.05,0.05,0.022"}, in), reachOf({}, in));
  EXPECT_LT(reachOf({"--steps", "1"}, in), reachOf({}, in));
  PrinterProfile profile;
  profile.name = "mine";
  profile.pitch_mm = pitch_mm;
  profile.point_spread_mm = Vec3d(0.08);
  in.metadata["vdbdither:printer"] = toJson(profile);
  EXPECT_EQ(reachOf({}, in), reachOf({"--spread", "80um"}, in));
}

TEST(Compensate, RefusesASpreadThatReachesTooFar) {
  EXPECT_THAT(test::planning("compensate", bar(), {"--spread", "0.9mm"}),
              ThrowsMessage<UsageError>(HasSubstr("--spread: the droplets would reach over more "
                                                  "than 100 voxels; give a smaller spread")));
}

TEST(Compensate, RefusesASpreadOfNothing) {
  EXPECT_THAT(test::planning("compensate", bar(), {"--spread", "0"}),
              ThrowsMessage<UsageError>(HasSubstr("--spread: must be above 0 mm along an axis")));
}

TEST(Compensate, RefusesABandWithoutAVoxelsDiagonal) {
  EXPECT_THAT(test::planning("compensate", bar(0.05), {}),
              ThrowsMessage<DataError>(HasSubstr("holds distances up to 0.05 mm, and 'compensate' "
                                                 "needs 0.0965 mm: widen --band of mesh2sdf or "
                                                 "resample by 0.047 mm")));
}

}  // namespace
}  // namespace vdbdither
