#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "ops/kernels/leaf/held_band.h"
#include "tests/support/filters.h"
#include "tests/support/volumes.h"
#include "vdbdither/model/errors.h"

namespace vdbdither {
namespace {

using openvdb::FloatGrid;
using openvdb::Vec3d;
using testing::HasSubstr;
using testing::ThrowsMessage;

const Lattice lattice = test::latticeAround({0.042, 0.084, 0.022}, Vec3d(0.9), 0.2);

Schema ballWithBand(double band_mm) { return test::ballWithBand(lattice, 0.8, band_mm); }

auto planning(const Schema& schema, const std::vector<std::string>& arguments) {
  return test::planning("hollow", schema, arguments);
}

TEST(Hollow, SaysWhichBandItNeeds) {
  EXPECT_THAT(
      planning(ballWithBand(0.29), {"--thickness", "0.2"}),
      ThrowsMessage<DataError>(
          "grid 'surface' holds distances up to 0.29 mm, and a shell of 0.2 mm needs 0.2965 mm: "
          "widen --band of mesh2sdf or resample by 0.007 mm"));
  EXPECT_NO_THROW(planning(ballWithBand(0.297), {"--thickness", "0.2"})());
}

TEST(Hollow, ABandInDiametersCountsByItsLeast) {
  const auto surface = FloatGrid::create(0.3F);
  setHeldBandMm(*surface, 0.066);
  EXPECT_THAT(planning(test::schemaOf(lattice, {{"surface", surface}}), {"--thickness", "0.1"}),
              ThrowsMessage<DataError>(HasSubstr("up to 0.066 mm, and a shell")));
}

TEST(Hollow, LeavesTheDitherItsBandAndDropsWhatIsOfTheOldSurface) {
  Schema schema = ballWithBand(0.4);
  schema.grids["N"] = openvdb::Vec3SGrid::create();
  schema.grids["part"] = openvdb::Int32Grid::create();
  const Schema out = test::filterCalled("hollow", {"--thickness", "0.3"})->plan(schema);
  EXPECT_FALSE(out.grids.contains("N"));
  EXPECT_TRUE(out.grids.contains("part"));
  const auto surface = openvdb::gridConstPtrCast<FloatGrid>(out.grids.at("surface"));
  EXPECT_NEAR(surface->background(), 0.1, 1e-6);
  EXPECT_NO_THROW(test::filterCalled("dither", {"--mask", "white"})->plan(out));
}

TEST(Hollow, TheBoxGivesBackWhatTheBandNeededOfItWhereThatIsKnown) {
  Schema schema = ballWithBand(0.4);
  EXPECT_EQ(test::filterCalled("hollow", {"--thickness", "0.3"})->plan(schema).lattice.box,
            lattice.box);
  const auto told = openvdb::gridConstPtrCast<FloatGrid>(schema.grids["surface"])->deepCopy();
  setHeldBandMm(*told, 0.4);
  schema.grids["surface"] = told;
  const openvdb::CoordBBox box =
      test::filterCalled("hollow", {"--thickness", "0.3"})->plan(schema).lattice.box;
  EXPECT_EQ(box.min() - lattice.box.min(), openvdb::Coord(7, 3, 13));
  EXPECT_EQ(lattice.box.max() - box.max(), openvdb::Coord(7, 3, 13));
}

TEST(Hollow, RefusesDrainsThatAreNone) {
  const auto drained = [](const std::string& drain) {
    return planning(ballWithBand(0.4), {"--thickness", "0.2", "--drain", drain});
  };
  for (const char* bad : {"", "1,2,3", "0,0,0:0,0,1", "0,0,0:0,0,1:", "0,0,0:0,0,1:x",
                          "1e300,0,0:0,0,1:1", "0,0,0:1e200,1e200,1:1"}) {
    EXPECT_THAT(drained(bad), ThrowsMessage<UsageError>(
                                  HasSubstr("is not a position, a direction and a diameter")))
        << bad;
  }
  EXPECT_THAT(drained("0,0,0:0,0,0:1mm"),
              ThrowsMessage<UsageError>("--drain: '0,0,0:0,0,0:1mm' has no direction"));
  EXPECT_THAT(drained("0,0,0:0,0,1:0"), ThrowsMessage<UsageError>(HasSubstr("has no diameter")));
  EXPECT_THAT(drained("5,0,0:0,0,1:1mm"),
              ThrowsMessage<UsageError>(HasSubstr("is nowhere near the part, which lies between")));
  EXPECT_NO_THROW(drained("0,0,-0.8:0,0,1:0.3mm")());
}

TEST(Hollow, TakesSeveralDrains) {
  const Schema schema = ballWithBand(0.4);
  const auto filter = test::filterCalled(
      "hollow",
      {"--thickness", "0.2", "--drain", "0,0,-0.8:0,0,1:0.3mm", "--drain", "0.8,0,0:1,0,0:0.3mm"});
  const Grids made = test::runWhole(*filter, schema);
  const auto surface = openvdb::gridConstPtrCast<FloatGrid>(made.at("surface"));
  EXPECT_GT(surface->tree().getValue({0, 0, -32}), 0);
  EXPECT_GT(surface->tree().getValue({17, 0, 0}), 0);
  EXPECT_LT(surface->tree().getValue({0, 0, 32}), 0);
  EXPECT_LT(surface->tree().getValue({-17, 0, 0}), 0);
}

TEST(Hollow, RefusesToRunWithoutAThicknessOrASurface) {
  EXPECT_THAT(planning(ballWithBand(0.4), {}),
              ThrowsMessage<UsageError>("'--thickness' is missing; see --help"));
  EXPECT_THAT(planning(ballWithBand(0.4), {"--thickness", "0"}),
              ThrowsMessage<UsageError>("--thickness: '0' is not accepted; the length must be "
                                        "greater than 0 mm, up to 1000 mm"));
  EXPECT_THAT(planning(test::schemaOf(lattice, {}), {"--thickness", "1"}),
              ThrowsMessage<DataError>("no grid 'surface'; there is none"));
}

}  // namespace
}  // namespace vdbdither
