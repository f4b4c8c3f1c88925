#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "io/profile/printer_profile.h"
#include "tests/support/filters.h"
#include "vdbdither/model/errors.h"

namespace vdbdither {
namespace {

using openvdb::BoolGrid;
using openvdb::Coord;
using openvdb::CoordBBox;
using openvdb::FloatGrid;
using openvdb::Vec3d;
using testing::HasSubstr;
using testing::ThrowsMessage;

const Lattice mimaki{{0.042, 0.084, 0.022}, {0, 0, 0}, CoordBBox(Coord(-20), Coord(40, 25, 60))};

Schema block() {
  const auto solid = BoolGrid::create(false);
  solid->setName("solid");
  solid->setTransform(std::make_shared<openvdb::math::Transform>(
      std::make_shared<openvdb::math::ScaleMap>(mimaki.pitch_mm)));
  solid->tree().sparseFill(CoordBBox(Coord(0), Coord(30, 15, 45)), true);
  return test::schemaOf(mimaki, {{"solid", solid}});
}

int reachOf(const std::vector<std::string>& arguments, const Schema& schema) {
  const auto simulate = test::filterCalled("simulate", arguments);
  simulate->plan(schema);
  return simulate->reads().at(0).reach.above;
}

TEST(Simulate, AnnouncesAnOccupancyOnTheSameLattice) {
  const Schema in = block();
  const GridConstPtr planned = test::filterCalled("simulate")->plan(in).grids.at("printed");
  EXPECT_EQ(planned->getName(), "printed");
  EXPECT_EQ(planned->getGridClass(), openvdb::GRID_FOG_VOLUME);
  EXPECT_EQ(planned->transform(), in.grids.at("solid")->transform());
}

TEST(Simulate, ThePrintIsWholeWithinAndReachesALittleBeyondTheVoxels) {
  const auto simulate = test::filterCalled("simulate");
  const auto whole =
      openvdb::gridConstPtrCast<FloatGrid>(test::runWhole(*simulate, block()).at("printed"));
  EXPECT_EQ(whole->tree().getValue(Coord(15, 8, 20)), 1.0F);
  EXPECT_GT(whole->tree().getValue(Coord(15, 8, 47)), 0.0F);
  EXPECT_EQ(whole->tree().getValue(Coord(15, 8, 58)), 0.0F);
}

TEST(Simulate, TheSpreadComesFromTheCommandLineThePrinterOrIsFiftyMicrometres) {
  Schema in = block();
  const int usual = reachOf({}, in);
  EXPECT_EQ(usual, reachOf({"--spread", "50um"}, in));
  EXPECT_EQ(reachOf({"--spread", "0.1,0.1,0.022"}, in), 4);
  PrinterProfile profile;
  profile.name = "mine";
  profile.pitch_mm = mimaki.pitch_mm;
  in.metadata["vdbdither:printer"] = toJson(profile);
  EXPECT_EQ(reachOf({}, in), usual) << "it states none";
  profile.point_spread_mm = Vec3d(0.05, 0.05, 0.022);
  in.metadata["vdbdither:printer"] = toJson(profile);
  EXPECT_EQ(reachOf({}, in), 4);
  EXPECT_EQ(reachOf({"--spread", "50um"}, in), usual);
}

TEST(Simulate, RefusesWhatItCannotDo) {
  const auto plan = [](const std::vector<std::string>& arguments) {
    return [arguments] { test::filterCalled("simulate", arguments)->plan(block()); };
  };
  for (const std::string spread : {"1,2", "-1um", "1e9mm", "x"}) {
    EXPECT_THAT(plan({"--spread", spread}),
                ThrowsMessage<UsageError>(
                    "--spread: '" + spread +
                    "' is not accepted; the value must be one length or three, separated by "
                    "commas, each from 0 mm to 100 mm"));
  }
  EXPECT_THAT(plan({"--spread", "10cm"}),
              ThrowsMessage<UsageError>("--spread: the droplets would reach over more than 500 "
                                        "voxels; give a smaller spread"));
  EXPECT_THAT([] { test::filterCalled("simulate")->plan(test::schemaOf(mimaki, {})); },
              ThrowsMessage<DataError>("no grid 'solid'; there is none"));
}

}  // namespace
}  // namespace vdbdither
