#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "io/profile/material_table.h"
#include "io/profile/printer_profile.h"
#include "tests/support/contract.h"
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

TEST(Simulate, VoxelsThatTouchTheirBoxSpreadBeyondIt) {
  const auto solid = BoolGrid::create(false);
  const CoordBBox all(Coord(0), Coord(30, 14, 60));
  solid->sparseFill(all, true);
  solid->setTransform(transformOf({mimaki.pitch_mm, Vec3d(0.0), all}));
  solid->setName("solid");
  const Schema in = test::schemaOf({mimaki.pitch_mm, Vec3d(0.0), all}, {{"solid", solid}});
  const auto simulate = test::filterCalled("simulate");
  const CoordBBox grown = simulate->plan(in).lattice.box;
  EXPECT_EQ(grown.min().z(), -simulate->reads().at(0).reach.above);
  const ZRange layers{grown.min().z(), grown.max().z() + 1};
  const auto printed = openvdb::gridConstPtrCast<FloatGrid>(
      simulate->run({layers, layers, {{"solid", solid}}}).at("printed"));
  const auto& tree = printed->tree();
  EXPECT_GT(tree.getValue(Coord(15, 7, 62)), 0.01F);
  EXPECT_EQ(tree.getValue(Coord(15, 7, 62)), tree.getValue(Coord(15, 7, -2)));
  EXPECT_GT(tree.getValue(Coord(32, 7, 30)), 0.01F);
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

Schema blockOfTwoMaterials() {
  Schema in = block();
  const auto solid = openvdb::gridConstPtrCast<BoolGrid>(in.grids.at("solid"));
  const auto material = openvdb::Int32Grid::create(0);
  material->setName("material");
  material->setTransform(solid->transform().copy());
  for (auto voxel = solid->cbeginValueOn(); voxel; ++voxel) {
    const CoordBBox filled = voxel.getBoundingBox();
    for (auto ijk = filled.begin(); ijk; ++ijk)
      material->tree().setValue(*ijk, (*ijk).x() < 15 ? 1 : 2);
  }
  in.grids["material"] = material;
  in.metadata["vdbdither:materials"] =
      toJson(MaterialTable{{"white", {255, 255, 255, 255}}, {"black", {0, 0, 0, 255}}});
  return in;
}

TEST(Simulate, ShowsTheColoursOfTheMaterialsBlurred) {
  const auto simulate = test::filterCalled("simulate", {"--translucency", "50um"});
  const Grids out = test::runWhole(*simulate, blockOfTwoMaterials());
  const auto colours = openvdb::gridConstPtrCast<openvdb::Vec3SGrid>(out.at("Cd"));
  EXPECT_EQ(colours->getName(), "Cd");
  EXPECT_EQ(colours->getVectorType(), openvdb::VEC_INVARIANT);
  const auto shown = [&](int x) { return colours->tree().getValue(Coord(x, 8, 45))[1]; };
  EXPECT_NEAR(shown(2), 1, 1e-3);
  EXPECT_NEAR(shown(28), 0, 1e-3);
  // Half of each, by the law of Yule and Nielsen with n = 2, lies between the two in the middle.
  EXPECT_GT(shown(14), 0.25F);
  EXPECT_LT(shown(15), 0.25F);
  EXPECT_NEAR((std::sqrt(shown(14)) + std::sqrt(shown(15))) / 2, 0.5, 1e-3);
}

TEST(Simulate, ColoursDoNotDependOnSlabs) {
  const auto simulate = test::filterCalled("simulate", {"--translucency", "50um"});
  const Schema in = blockOfTwoMaterials();
  simulate->plan(in);
  EXPECT_EQ(test::firstBreach(*simulate, in, in.grids, 8), "");
}

TEST(Simulate, RefusesColoursThatItDoesNotKnow) {
  const auto plan = [](const std::string& length, const Schema& in) {
    return [=] { test::filterCalled("simulate", {"--translucency", length})->plan(in); };
  };
  EXPECT_THAT(plan("50um", block()), ThrowsMessage<DataError>(HasSubstr("no grid 'material'")));
  Schema in = blockOfTwoMaterials();
  EXPECT_THAT(plan("10mm", in),
              ThrowsMessage<UsageError>("--translucency: the light would reach over more than 64 "
                                        "voxels; give a smaller length"));
  in.metadata.erase("vdbdither:materials");
  EXPECT_THAT(plan("50um", in),
              ThrowsMessage<DataError>("--translucency: no table of materials says what colour "
                                       "'material' has; make it with halftone or material-assign"));
}

}  // namespace
}  // namespace vdbdither
