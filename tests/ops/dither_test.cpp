#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <optional>
#include <unistd.h>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <openvdb/tools/Prune.h>

#include "io/file/digest.h"
#include "io/profile/printer_profile.h"
#include "io/vdb/vdb.h"
#include "ops/kernels/mask/mask_tile.h"
#include "ops/kernels/mask/threshold_mask.h"
#include "tests/support/dither_reference.h"
#include "tests/support/filters.h"
#include "tests/support/scratch_folder.h"
#include "vdbdither/model/errors.h"

namespace vdbdither {
namespace {

using openvdb::BoolGrid;
using openvdb::Coord;
using openvdb::CoordBBox;
using openvdb::FloatGrid;
using openvdb::Vec3d;
using testing::AllOf;
using testing::HasSubstr;
using testing::ThrowsMessage;

const Lattice mimaki = test::latticeAround({0.042, 0.084, 0.022}, {0.6, 0.6, 0.6}, 0.3);

Schema ballOn(const Lattice& lattice) {
  return test::schemaOf(
      lattice, {{"surface", test::sampled(test::sphere({0.01, 0.02, -0.1}, 0.55), lattice, 0.2)}});
}

TEST(Dither, MakesTheSameOfSlabsOfAnyHeightWhateverLiesBeyondItsReach) {
  const Schema plain = ballOn(mimaki);
  Schema with_normals = plain;
  with_normals.grids.merge(test::runWhole(*test::filterCalled("normals"), plain));
  for (const Schema& schema : {plain, with_normals}) {
    for (const std::string at : {"closest", "foot", "voxel"}) {
      for (const std::string amplitude : {"2", "4", "8"}) {
        const auto dither =
            test::filterCalled("dither", {"--mask", "white", "--at", at, "--amplitude", amplitude});
        const auto solid =
            openvdb::gridConstPtrCast<BoolGrid>(test::runWhole(*dither, schema).at("solid"));
        const test::Voxels whole = test::dense(*solid, mimaki.box);
        for (const int height : {8, 16, 64}) {
          EXPECT_EQ(
              test::differences(test::solidOfSlabs(*dither, schema, height, mimaki.box), whole), 0)
              << at << " " << height;
        }
      }
    }
  }
}

TEST(Dither, AtTheVoxelWithoutAGuardReadsTheLayersOfItsOwnGradient) {
  const Schema schema = ballOn(mimaki);
  const auto dither = test::filterCalled(
      "dither", {"--mask", "white", "--at", "voxel", "--guard", "none", "--amplitude", "8"});
  const auto solid =
      openvdb::gridConstPtrCast<BoolGrid>(test::runWhole(*dither, schema).at("solid"));
  EXPECT_EQ(test::differences(test::solidOfSlabs(*dither, schema, 8, mimaki.box),
                              test::dense(*solid, mimaki.box)),
            0);
}

TEST(Dither, LeavesItsInputUntouched) {
  const Schema schema = ballOn(mimaki);
  const auto before = openvdb::gridConstPtrCast<FloatGrid>(schema.grids.at("surface"))->deepCopy();
  test::runWhole(*test::filterCalled("dither", {"--mask", "white", "--displaced"}), schema);
  const auto after = openvdb::gridConstPtrCast<FloatGrid>(schema.grids.at("surface"));
  EXPECT_EQ(test::dense(*before, mimaki.box), test::dense(*after, mimaki.box));
  EXPECT_TRUE(before->tree().hasSameTopology(after->tree()));
}

TEST(Dither, MakesNothingOfEmptySlabs) {
  const Schema schema = test::schemaOf(mimaki, {{"surface", FloatGrid::create(0.2F)}});
  const Grids out =
      test::runWhole(*test::filterCalled("dither", {"--mask", "white", "--displaced"}), schema);
  EXPECT_TRUE(openvdb::gridConstPtrCast<BoolGrid>(out.at("solid"))->empty());
  EXPECT_TRUE(openvdb::gridConstPtrCast<FloatGrid>(out.at("displaced"))->empty());
}

TEST(Dither, FillsTheInteriorWithTiles) {
  const Lattice lattice = test::latticeAround(mimaki.pitch_mm, Vec3d(1.0), 0.2);
  const Schema schema = test::schemaOf(
      lattice, {{"surface", test::sampled(test::sphere(Vec3d(0.0), 1), lattice, 0.2)}});
  const auto solid = openvdb::gridConstPtrCast<BoolGrid>(
      test::runWhole(*test::filterCalled("dither", {"--mask", "white"}), schema).at("solid"));
  EXPECT_GT(solid->tree().activeTileCount(), 0U);
  auto canonical = solid->deepCopy();
  canonical->tree().voxelizeActiveTiles();
  openvdb::tools::prune(canonical->tree());
  EXPECT_EQ(canonical->tree().activeTileCount(), solid->tree().activeTileCount());
  EXPECT_EQ(canonical->tree().leafCount(), solid->tree().leafCount());
}

TEST(Dither, PassesOnWhatItReadAndAnnouncesWhatItMakes) {
  const Schema in = ballOn(mimaki);
  const Schema out = test::filterCalled("dither", {"--mask", "none", "--displaced"})->plan(in);
  EXPECT_EQ(out.grids.at("surface"), in.grids.at("surface"));
  EXPECT_EQ(out.lattice, in.lattice);
  EXPECT_EQ(out.grids.at("solid")->valueType(), "bool");
  EXPECT_EQ(out.grids.at("displaced")->getGridClass(), openvdb::GRID_LEVEL_SET);
  EXPECT_EQ(out.grids.at("displaced")->transform(), out.grids.at("surface")->transform());
  EXPECT_TRUE(out.grids.at("displaced")->empty());
}

TEST(Dither, WithoutAMaskIsPlainVoxelizationAndReadsNoHalo) {
  const Schema schema = ballOn(mimaki);
  const auto dither = test::filterCalled("dither", {"--mask", "none"});
  const auto solid =
      openvdb::gridConstPtrCast<BoolGrid>(test::runWhole(*dither, schema).at("solid"));
  const auto surface = openvdb::gridConstPtrCast<FloatGrid>(schema.grids.at("surface"));
  EXPECT_EQ(test::dense(*solid, mimaki.box), test::plainVoxels(test::dense(*surface, mimaki.box)));
  ASSERT_EQ(dither->reads().size(), 1U);
  EXPECT_EQ(dither->reads()[0].reach.below, 0);
}

TEST(Dither, WhiteNoiseDependsOnTheSeedAlone) {
  const Schema schema = ballOn(mimaki);
  const auto solid = [&](const char* seed) {
    const auto dither = test::filterCalled("dither", {"--mask", "white", "--seed", seed});
    return test::dense(
        *openvdb::gridConstPtrCast<BoolGrid>(test::runWhole(*dither, schema).at("solid")),
        mimaki.box);
  };
  EXPECT_EQ(solid("4"), solid("4"));
  EXPECT_GT(test::differences(solid("4"), solid("5")), 10);
}

/// Writes a grid `mask` to a file that goes away with the test.
class MaskFile : public testing::Test {
 protected:
  std::string write(const FloatGrid::Ptr& mask) {
    mask->setName("mask");
    openvdb::io::File(path_.string()).write({mask});
    return path_.string();
  }
  static void SetUpTestSuite() { initializeVdb(); }
  ~MaskFile() override { std::filesystem::remove(path_); }

  static FloatGrid::Ptr filled(const CoordBBox& box, float value) {
    auto grid = FloatGrid::create(0.0F);
    grid->denseFill(box, value);
    return grid;
  }

  static auto planning(const std::string& mask) {
    return [mask] { test::filterCalled("dither", {"--mask", mask})->plan(ballOn(mimaki)); };
  }

  std::filesystem::path path_ =
      std::filesystem::temp_directory_path() / ("mask" + std::to_string(getpid()) + ".vdb");
};

TEST_F(MaskFile, IsReadAtTheAbsoluteIndexModuloItsSize) {
  auto grid = filled(CoordBBox(Coord(0), Coord(1, 10, 3)), 0.5F);
  float value = 0.01F;
  for (auto voxel = grid->beginValueOn(); voxel; ++voxel) voxel.setValue(value += 0.01F);
  const ThresholdMask mask(*grid);
  for (const Coord& at : {Coord(0), Coord(1, 2, 3), Coord(0, 10, 1)}) {
    EXPECT_EQ(mask(at), grid->tree().getValue(at));
    EXPECT_EQ(mask(at + Coord(20, -33, 400)), grid->tree().getValue(at));
    EXPECT_EQ(mask(at - Coord(2, 11, 4)), grid->tree().getValue(at));
  }
}

TEST_F(MaskFile, OfOneHalfEverywherePrintsPlainVoxels) {
  const Schema schema = ballOn(mimaki);
  const auto solid = [&](const std::string& mask) {
    const auto dither = test::filterCalled("dither", {"--preset", "paper", "--mask", mask});
    return test::dense(
        *openvdb::gridConstPtrCast<BoolGrid>(test::runWhole(*dither, schema).at("solid")),
        mimaki.box);
  };
  EXPECT_EQ(solid(write(filled(CoordBBox(Coord(0), Coord(3)), 0.5F))), solid("none"));
}

TEST_F(MaskFile, RefusesAMissingFile) {
  EXPECT_THAT(planning("nowhere.vdb"),
              ThrowsMessage<UsageError>(HasSubstr("--mask: no such file 'nowhere.vdb'")));
}

TEST_F(MaskFile, RefusesThresholdsOutsideTheOpenUnitInterval) {
  for (const auto& [bad, refusal] :
       {std::pair(0.0F, "thresholds between 0 and 1"),
        {1.0F, "thresholds between 0 and 1"},
        {-3.0F, "thresholds between 0 and 1"},
        {std::nanf(""), "holds nan at voxel 1 2 3, which is not a finite"}}) {
    auto grid = filled(CoordBBox(Coord(0), Coord(3)), 0.5F);
    grid->tree().setValue({1, 2, 3}, bad);
    EXPECT_THAT(planning(write(grid)), ThrowsMessage<DataError>(HasSubstr(refusal)));
  }
}

TEST_F(MaskFile, RefusesThresholdsThatAreNotFinite) {
  auto grid = filled(CoordBBox(Coord(0), Coord(3)), 0.5F);
  grid->tree().setValue({1, 2, 3}, std::nanf(""));
  EXPECT_THAT(planning(write(grid)), ThrowsMessage<DataError>(HasSubstr("nan at voxel 1 2 3")));
}

TEST_F(MaskFile, RefusesWhatIsNotABoxFromTheOrigin) {
  auto holed = filled(CoordBBox(Coord(0), Coord(3)), 0.5F);
  holed->tree().setValueOff({1, 1, 1});
  EXPECT_THAT(planning(write(holed)), ThrowsMessage<DataError>(HasSubstr("--mask: ")));
  EXPECT_THAT(planning(write(filled(CoordBBox(Coord(1), Coord(3)), 0.5F))),
              ThrowsMessage<DataError>(HasSubstr("here 27 are active from 1,1,1 to 3,3,3")));
  EXPECT_THAT(planning(write(FloatGrid::create(0.0F))),
              ThrowsMessage<DataError>(HasSubstr("there are none")));
}

TEST_F(MaskFile, RefusesWhatIsNoVdbFile) {
  std::ofstream(path_) << "not a grid";
  EXPECT_THAT(planning(path_.string()),
              ThrowsMessage<DataError>(AllOf(HasSubstr("--mask: "), HasSubstr(path_.string()))));
}

/// Sets the folder of the cache for a test.
class CacheFolder {
 public:
  CacheFolder() {
    if (const char* before = std::getenv(variable)) before_ = before;
    setenv(variable, folder_.path().c_str(), 1);
  }
  CacheFolder(const CacheFolder&) = delete;
  CacheFolder& operator=(const CacheFolder&) = delete;
  ~CacheFolder() { before_ ? setenv(variable, before_->c_str(), 1) : unsetenv(variable); }

 private:
  static constexpr const char* variable = "XDG_CACHE_HOME";
  test::ScratchFolder folder_;
  std::optional<std::string> before_;
};

TEST_F(MaskFile, OfEveryJobOfAProcessIsItsOwnMadeOrKept) {
  const CacheFolder cache;
  const Schema schema = ballOn(mimaki);
  const auto solid = [&](const std::vector<std::string>& options) {
    return test::dense(
        *openvdb::gridConstPtrCast<BoolGrid>(
            test::runWhole(*test::filterCalled("dither", options), schema).at("solid")),
        mimaki.box);
  };
  for (const char* run : {"made", "kept"}) {
    for (const int size : {6, 8}) {
      for (const int seed : {1, 2}) {
        VoidAndCluster settings = defaultMask();
        settings.size = Coord(size);
        settings.seed = static_cast<std::uint64_t>(seed);
        const test::Voxels expected = solid({"--mask", write(maskOf(settings))});
        EXPECT_EQ(solid({"--size", std::to_string(size), "--seed", std::to_string(seed)}), expected)
            << run << " " << size << " " << seed;
      }
    }
  }
}

TEST(Dither, RefusesASurfaceThatDoesNotReachFarEnough) {
  const Schema thin = test::schemaOf(mimaki, {{"surface", FloatGrid::create(0.09F)}});
  EXPECT_THAT(
      [&] {
        test::filterCalled("dither", {"--mask", "white", "--preset", "paper"})->plan(thin);
      },
      ThrowsMessage<DataError>(
          "grid 'surface' holds distances up to 0.09 mm, and --amplitude 4 "
          "needs 0.0965 mm: widen --band of mesh2sdf or resample by 0.007 mm"));
  EXPECT_THAT(
      [&] {
        test::filterCalled("dither", {"--mask", "white"})->plan(thin);
      },
      ThrowsMessage<DataError>(HasSubstr("--amplitude 2 needs 0.0965 mm")));
  EXPECT_NO_THROW(test::filterCalled("dither", {"--mask", "none"})->plan(thin));
}

TEST(Dither, RefusesToRunWithoutASurface) {
  const Schema none = test::schemaOf(mimaki, {{"solid", BoolGrid::create(false)}});
  EXPECT_THAT(
      [&] {
        test::filterCalled("dither", {"--mask", "white"})->plan(none);
      },
      ThrowsMessage<DataError>("no grid 'surface'; there is 'solid'"));
  const Schema wrong = test::schemaOf(mimaki, {{"surface", BoolGrid::create(false)}});
  EXPECT_THAT(
      [&] {
        test::filterCalled("dither", {"--mask", "white"})->plan(wrong);
      },
      ThrowsMessage<DataError>("grid 'surface' is of bool, not of float"));
}

TEST(Dither, RefusesAmplitudesBeyondEightAndPlacesItDoesNotKnow) {
  const auto planning = [](const std::string& option, const std::string& value) {
    return [option, value] {
      test::filterCalled("dither", {"--mask", "white", option, value})->plan(ballOn(mimaki));
    };
  };
  for (const std::string bad : {"8.1", "-1", "nan", "4x", "much"}) {
    EXPECT_THAT(planning("--amplitude", bad),
                ThrowsMessage<UsageError>("--amplitude: '" + bad +
                                          "' is not accepted; the value must be a number from 0 "
                                          "to 8"));
  }
  EXPECT_THROW(planning("--at", "surface")(), UsageError);
  EXPECT_THROW(planning("--guard", "all")(), UsageError);
  EXPECT_THROW(test::filterCalled("dither", {"--preset", "worst"}), UsageError);
}

TEST(Dither, DiffusionRefusesABlurThatNoPrinterHas) {
  for (const std::string bad : {"2mm", "0.5um", "1e9mm"}) {
    EXPECT_THROW(test::filterCalled("dither", {"--spread", bad}), UsageError) << bad;
  }
}

TEST(Dither, RefusesOptionsOfTheOtherMethod) {
  const auto planning = [](const std::vector<std::string>& words) {
    return [words] { test::filterCalled("dither", words)->plan(ballOn(mimaki)); };
  };
  EXPECT_THAT(planning({"--method", "diffusion", "--at", "foot"}),
              ThrowsMessage<UsageError>("--at: only --method mask has it; leave it out"));
  EXPECT_THAT(planning({"--mask", "white", "--spread", "50um"}),
              ThrowsMessage<UsageError>("--spread: only --method diffusion has it; leave it out"));
  EXPECT_THAT(planning({"--method", "diffusion", "--displaced"}),
              ThrowsMessage<UsageError>("--displaced: only --method mask has it; leave it out"));
  EXPECT_NO_THROW(planning({"--method", "diffusion", "--spread", "25um,30um,40um"})());
}

test::Voxels solidBy(const std::vector<std::string>& options, const Schema& schema) {
  return test::dense(
      *openvdb::gridConstPtrCast<BoolGrid>(
          test::runWhole(*test::filterCalled("dither", options), schema).at("solid")),
      mimaki.box);
}

TEST(Dither, DiffusesByDefaultForTheBlurOfThePrinter) {
  Schema schema = ballOn(mimaki);
  const test::Voxels usual = solidBy({}, schema);
  EXPECT_EQ(usual, solidBy({"--method", "diffusion", "--spread", "50um"}, schema));
  EXPECT_GT(test::differences(usual, solidBy({"--spread", "25um"}, schema)), 10);
  PrinterProfile printer;
  printer.name = "mine";
  printer.pitch_mm = mimaki.pitch_mm;
  printer.point_spread_mm = Vec3d(0.03, 0.04, 0.05);
  schema.metadata["vdbdither:printer"] = toJson(printer);
  EXPECT_EQ(solidBy({}, schema), solidBy({"--spread", "0.03,0.04,0.05"}, schema));
}

TEST(Dither, DiffusionMakesTheSameOfSlabsOfAnyHeight) {
  // On the second lattice blocks are two leaves high.
  const Lattice fine = test::latticeAround({0.042, 0.084, 0.014}, {0.6, 0.6, 0.6}, 0.3);
  for (const Lattice& lattice : {mimaki, fine}) {
    Schema schema = test::schemaOf(
        lattice,
        {{"surface", test::sampled(test::sphere({0.01, 0.02, -0.1}, 0.55), lattice, 0.2)}});
    for (const bool with_normals : {false, true}) {
      if (with_normals)
        schema.grids.merge(test::runWhole(*test::filterCalled("normals"), Schema(schema)));
      const auto dither = test::filterCalled("dither");
      const test::Voxels whole = test::dense(
          *openvdb::gridConstPtrCast<BoolGrid>(test::runWhole(*dither, schema).at("solid")),
          lattice.box);
      for (const int height : {8, 16, 24, 64}) {
        EXPECT_EQ(
            test::differences(test::solidOfSlabs(*dither, schema, height, lattice.box), whole), 0)
            << height;
      }
    }
  }
}

/// The lattices of a Mimaki 3DUJ-553 and a Stratasys J750, around a small ball.
std::vector<Lattice> lattices() {
  return {test::latticeAround({0.042, 0.084, 0.022}, Vec3d(0.4), 0.3),
          test::latticeAround({0.04233, 0.08467, 0.027}, Vec3d(0.4), 0.3)};
}

Schema smallBallOn(const Lattice& lattice) {
  return test::schemaOf(
      lattice,
      {{"surface", test::sampled(test::sphere({0.011, 0.007, -0.013}, 0.4), lattice, 0.2)}});
}

TEST(Dither, DiffusionMakesTheSameOfLowSlabsForAShortAndALongBlur) {
  // Its sides are steep: what is decided in a layer matters far above and below.
  const auto part = test::box({0.011, 0.007, -0.013}, {0.2, 0.2, 0.6}, {4, -3, 20});
  for (const Vec3d& pitch_mm : {Vec3d(0.042, 0.084, 0.022), Vec3d(0.04233, 0.08467, 0.027)}) {
    const Lattice lattice = test::latticeAround(pitch_mm, {0.3, 0.3, 0.65}, 0.1);
    const Schema schema = test::schemaOf(lattice, {{"surface", test::sampled(part, lattice, 0.2)}});
    for (const std::string spread : {"10um", "120um"}) {
      for (const std::string guard : {"walls", "none"}) {
        const auto dither = test::filterCalled("dither", {"--spread", spread, "--guard", guard});
        const auto solid =
            openvdb::gridConstPtrCast<BoolGrid>(test::runWhole(*dither, schema).at("solid"));
        EXPECT_EQ(test::differences(test::solidOfSlabs(*dither, schema, 8, lattice.box),
                                    test::dense(*solid, lattice.box)),
                  0)
            << spread << " " << guard << " " << lattice.pitch_mm;
      }
    }
  }
}

/// Only a change of the default that is meant to change prints may change these digests. To renew
/// one, copy it from the failure; the change belongs into CHANGELOG.md.
TEST(Dither, ByDefaultMakesTheVoxelsThatItAlwaysMade) {
  std::vector<std::string> digests;
  for (const Lattice& lattice : lattices()) {
    const auto solid = openvdb::gridConstPtrCast<BoolGrid>(
        test::runWhole(*test::filterCalled("dither"), smallBallOn(lattice)).at("solid"));
    Digest digest;
    for (auto voxel = lattice.box.begin(); voxel; ++voxel) {
      const char printed = solid->tree().getValue(*voxel) ? 1 : 0;
      digest.update(&printed, 1);
    }
    digests.push_back(hexText(digest.finish()).substr(0, 16));
  }
  EXPECT_THAT(digests, testing::ElementsAre("63d6d11d14225fd2", "a9ed00330d8ff89a"));
}

test::Voxels solidBy(const std::vector<std::string>& options) {
  const Schema schema = ballOn(mimaki);
  std::vector<std::string> words{"--mask", "white"};
  words.insert(words.end(), options.begin(), options.end());
  return test::dense(*openvdb::gridConstPtrCast<BoolGrid>(
                         test::runWhole(*test::filterCalled("dither", words), schema).at("solid")),
                     mimaki.box);
}

TEST(Dither, PresetsAreWhatTheirOptionsSay) {
  EXPECT_EQ(solidBy({}), solidBy({"--preset", "best"}));
  EXPECT_EQ(solidBy({}), solidBy({"--preset", "paper", "--amplitude", "2", "--at", "voxel",
                                  "--guard", "walls"}));
  EXPECT_EQ(solidBy({"--preset", "paper"}),
            solidBy({"--amplitude", "4", "--at", "closest", "--guard", "none"}));
  EXPECT_GT(test::differences(solidBy({}), solidBy({"--preset", "paper"})), 500);
}

}  // namespace
}  // namespace vdbdither
