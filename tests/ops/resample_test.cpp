#include <cmath>
#include <functional>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "io/vdb/vdb.h"
#include "tests/support/scratch_folder.h"
#include "tests/support/told.h"
#include "tests/support/volumes.h"
#include "vdbdither/engine/operator.h"
#include "vdbdither/engine/registry.h"
#include "vdbdither/model/errors.h"

namespace vdbdither {
namespace {

using openvdb::Coord;
using openvdb::CoordBBox;
using openvdb::FloatGrid;
using openvdb::Vec3d;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::ThrowsMessage;

/// A level set or fog as other tools write them.
class ResampleTest : public testing::Test {
 protected:
  ResampleTest() { initializeVdb(); }

  /// A ball of 0.9 mm in a grid of cubes of 0.06 mm, turned and moved; values from its distance.
  static FloatGrid::Ptr ball(const std::function<double(double)>& value, float background,
                             double unit = 1) {
    const auto grid = FloatGrid::create(background);
    const auto transform = openvdb::math::Transform::createLinearTransform(0.06 * unit);
    transform->postRotate(0.3, openvdb::math::Y_AXIS);
    transform->postTranslate(centre * unit);
    grid->setTransform(transform);
    for (const Coord& ijk : CoordBBox(Coord(-20), Coord(20))) {
      const double v = value(0.06 * ijk.asVec3d().length() - 0.9);
      if (v != double{background}) grid->tree().setValueOn(ijk, static_cast<float>(v));
    }
    grid->setGridClass(openvdb::GRID_LEVEL_SET);
    grid->setName("ball");
    return grid;
  }
  /// In index units, as some level sets are, three voxels to either side.
  static FloatGrid::Ptr levelSet(double unit = 1) {
    return ball([](double d) { return std::clamp(d / 0.06, -3.0, 3.0); }, 3, unit);
  }

  std::string write(const Grids& grids) {
    writeVdb(path, {grids, {}}, VdbCodec::blosc, path);
    return path.string();
  }

  static std::unique_ptr<Source> source(std::vector<std::string> arguments) {
    arguments.insert(arguments.end(), {"--printer", "mimaki-3duj-553"});
    auto made = findOperator("resample").make();
    Options options;
    made->declare(options);
    options.parse(arguments);
    return std::unique_ptr<Source>(&dynamic_cast<Source&>(*made.release()));
  }
  auto planning(const Grids& grids, std::vector<std::string> arguments = {}) {
    arguments.insert(arguments.begin(), write(grids));
    return [arguments] { source(arguments)->plan(); };
  }

  static void expectTheBall(const std::vector<std::string>& arguments, const Vec3d& middle) {
    const auto made = source(arguments);
    const Schema schema = made->plan();
    const auto surface =
        openvdb::gridConstPtrCast<FloatGrid>(made->run(schema.lattice.layers()).at("surface"));
    EXPECT_EQ(surface->getGridClass(), openvdb::GRID_LEVEL_SET);
    int active = 0;
    for (auto voxel = surface->cbeginValueOn(); voxel; ++voxel, ++active) {
      const double d = (schema.lattice.position(voxel.getCoord()) - middle).length() - 0.9;
      ASSERT_NEAR(*voxel, d, 0.1 * 0.022) << voxel.getCoord();
    }
    EXPECT_GT(active, 10000);
    EXPECT_LT(surface->tree().getValue(Coord::round(middle / schema.lattice.pitch_mm)), 0);
  }

  inline static const Vec3d centre{0.3, 1.2, -0.4};
  test::ScratchFolder folder;
  std::filesystem::path path = folder / "part.vdb";
};

TEST_F(ResampleTest, ALevelSetInAnyUnitBecomesDistancesInMillimetres) {
  expectTheBall({write({{"ball", levelSet()}})}, centre);
}

TEST_F(ResampleTest, SoDoesFogByTheValueAtItsSurface) {
  const auto fog = ball([](double d) { return std::clamp(0.5 - d / 0.36, 0.0, 1.0); }, 0);
  fog->setGridClass(openvdb::GRID_FOG_VOLUME);
  expectTheBall({write({{"density", fog}})}, centre);
  const auto thin = ball([](double d) { return std::clamp(0.2 - d / 0.36, 0.0, 1.0); }, 0);
  thin->setGridClass(openvdb::GRID_UNKNOWN);
  expectTheBall({write({{"density", thin}}), "--kind", "fog", "--level", "0.2"}, centre);
}

TEST_F(ResampleTest, UnitsScalesAndPlacesAreTaken) {
  expectTheBall({write({{"ball", levelSet(0.001)}}), "--unit", "m"}, centre);
  expectTheBall({write({{"ball", levelSet(0.5)}}), "--scale", "2"}, centre);
  expectTheBall({write({{"ball", levelSet()}}), "--place"},
                Vec3d(0.9) - 0.5 * Vec3d(0.042, 0.084, 0.022));
}

TEST_F(ResampleTest, TakesTheGridThatItIsTold) {
  const Grids grids{
      {"ball", levelSet()}, {"density", levelSet()}, {"v", openvdb::Vec3SGrid::create()}};
  EXPECT_THAT(planning(grids),
              ThrowsMessage<UsageError>("--grid: say which of 'ball' 'density' 'v'"));
  EXPECT_NO_THROW(planning(grids, {"--grid", "ball"})());
  EXPECT_THAT(planning(grids, {"--grid", "bell"}),
              ThrowsMessage<UsageError>("--grid: no grid 'bell'; there are 'ball' 'density' 'v'"));
  EXPECT_THAT(planning(grids, {"--grid", "v"}),
              ThrowsMessage<DataError>(
                  "grid 'v' is of vec3s, not of float, double, bool, mask or whole numbers"));
}

TEST_F(ResampleTest, RefusesWhatHasNoSurface) {
  const auto empty = FloatGrid::create(3);
  empty->setGridClass(openvdb::GRID_LEVEL_SET);
  EXPECT_THAT(planning({{"ball", empty}}),
              ThrowsMessage<DataError>(HasSubstr("grid 'ball' has no surface: none of its values "
                                                 "pass 0; check --kind and --level")));
  EXPECT_THAT(planning({{"ball", levelSet()}}, {"--kind", "fog"}),
              ThrowsMessage<DataError>(HasSubstr("is inside everywhere beyond its voxels")));
  EXPECT_THAT(planning({{"ball", levelSet()}}, {"--level", "7"}),
              ThrowsMessage<DataError>(HasSubstr("is inside everywhere beyond its voxels")));
  EXPECT_THAT(planning({{"ball", levelSet()}}, {"--level", "x"}),
              ThrowsMessage<UsageError>(
                  HasSubstr("--level: 'x' is not accepted; the value must be a number")));
  const auto classless = levelSet();
  classless->setGridClass(openvdb::GRID_UNKNOWN);
  EXPECT_THAT(planning({{"ball", classless}}),
              ThrowsMessage<UsageError>(HasSubstr("give --kind level-set or --kind fog")));
}

TEST_F(ResampleTest, RefusesWhatIsNoNumberAndWhatIsNoLattice) {
  for (const float bad : {std::nanf(""), std::numeric_limits<float>::infinity()}) {
    const auto grid = levelSet();
    grid->tree().setValueOn(Coord(15, 0, 0), bad);
    EXPECT_THAT(planning({{"ball", grid}}),
                ThrowsMessage<DataError>(
                    AllOf(HasSubstr("part.vdb': grid 'ball' holds "),
                          HasSubstr(" at voxel 15 0 0, which is not a finite number"))));
  }
  const auto frustum = levelSet();
  frustum->setTransform(openvdb::math::Transform::createFrustumTransform(
      openvdb::BBoxd(Vec3d(0), Vec3d(100)), 0.5, 10, 0.1));
  EXPECT_THAT(planning({{"ball", frustum}}),
              ThrowsMessage<DataError>(HasSubstr("grid 'ball' lies in a frustum")));
  EXPECT_THAT(planning({{"ball", levelSet(1e9)}}),
              ThrowsMessage<DataError>(HasSubstr("more voxels than can be counted")));
  EXPECT_THAT([] { source({"nowhere.vdb"})->plan(); },
              ThrowsMessage<DataError>(HasSubstr("no such file 'nowhere.vdb'")));
}

/// All grids that `arguments` make on cubes of 0.1 mm.
struct Taken {
  Grids grids;
  Lattice lattice;
  std::vector<std::string> warnings;
};

Taken taken(std::vector<std::string> arguments) {
  arguments.insert(arguments.end(), {"--pitch", "0.1mm,0.1mm,0.1mm"});
  const auto verb = findOperator("resample").make();
  Options options;
  verb->declare(options);
  test::Listener listener;
  verb->setReporter(&listener);
  options.parse(arguments);
  auto& source = dynamic_cast<Source&>(*verb);
  const Schema schema = source.plan();
  return {source.run(schema.lattice.layers()), schema.lattice, listener.warnings};
}

/// The volume in mm3 of what `arguments` make on cubes of 0.1 mm, and what is said about it.
struct Made {
  double mm3 = 0;
  std::vector<std::string> warnings;
};

Made made(std::vector<std::string> arguments) {
  const Taken all = taken(std::move(arguments));
  const auto surface = openvdb::gridConstPtrCast<FloatGrid>(all.grids.at("surface"));
  int inside = 0;
  for (const Coord& ijk : all.lattice.box) inside += surface->tree().getValue(ijk) < 0;
  return {inside * 1e-3, all.warnings};
}

constexpr double ball_mm3 = 33.51;  ///< of 2 mm
constexpr double near_mm3 = 0.7;

/// A ball of 2 mm on cubes of 0.2 mm: distances in voxels, and an identity for its transform.
FloatGrid::Ptr ballInVoxels() {
  const auto grid = FloatGrid::create(3);
  for (const Coord& ijk : CoordBBox(Coord(-14), Coord(14))) {
    const double d = ijk.asVec3d().length() - 10;
    if (std::abs(d) < 3) {
      grid->tree().setValueOn(ijk, static_cast<float>(d));
    } else if (d < 0) {
      grid->tree().setValueOff(ijk, -3);
    }
  }
  grid->setGridClass(openvdb::GRID_LEVEL_SET);
  return grid;
}

openvdb::math::Transform::Ptr fifths() {
  return openvdb::math::Transform::createLinearTransform(0.2);
}

TEST_F(ResampleTest, VoxelsOfPicoGkAreAsLargeAsItsMetadataSays) {
  const auto ball = ballInVoxels();
  ball->insertMeta("PicoGK.VoxelSize", openvdb::FloatMetadata(0.0002F));
  for (const std::vector<std::string>& unit : {std::vector<std::string>{}, {"--unit", "m"}}) {
    std::vector<std::string> arguments{write({{"PicoGK.Voxels.0", ball}})};
    arguments.insert(arguments.end(), unit.begin(), unit.end());
    const Made of_picogk = made(arguments);
    EXPECT_NEAR(of_picogk.mm3, ball_mm3, near_mm3);
    EXPECT_THAT(
        of_picogk.warnings,
        ElementsAre("grid 'PicoGK.Voxels.0' comes from PicoGK: its voxels are 0.2 mm, as its "
                    "metadata says"));
  }
  EXPECT_NEAR(made({write({{"a", ball}}), "--scale", "0.5"}).mm3, ball_mm3 / 8, near_mm3 / 4);
  const auto nonsense = ballInVoxels();
  nonsense->insertMeta("PicoGK.VoxelSize", openvdb::StringMetadata("0.2 mm"));
  EXPECT_THAT(made({write({{"a", nonsense}}), "--scale", "0.2"}).warnings,
              ElementsAre(HasSubstr("its metadata PicoGK.VoxelSize is no length in metres")));
  // A transform that says something is believed.
  ball->setTransform(openvdb::math::Transform::createLinearTransform(0.1));
  EXPECT_NEAR(made({write({{"a", ball}})}).mm3, ball_mm3 / 8, near_mm3 / 4);
}

TEST_F(ResampleTest, ALevelSetThatWasNeverFilledIsFilled) {
  const auto ball = ballInVoxels();
  ball->setTransform(fifths());
  EXPECT_NEAR(made({write({{"a", ball}})}).mm3, ball_mm3, near_mm3);
  EXPECT_THAT(made({write({{"a", ball}})}).warnings, IsEmpty());
  for (auto value = ball->beginValueOff(); value; ++value) {
    if (*value < 0) value.setValue(3);
  }
  const Made filled = made({write({{"a", ball}})});
  EXPECT_NEAR(filled.mm3, ball_mm3, near_mm3);
  EXPECT_THAT(filled.warnings,
              ElementsAre("grid 'a' has its inside at +background, as if it were "
                          "hollow; its surface is closed, and the inside is filled"));
  for (const Coord& ijk : CoordBBox(Coord(4, -2, -2), Coord(14, 2, 2)))
    ball->tree().setValueOff(ijk, 3);
  EXPECT_THAT(
      planning({{"a", ball}}),
      ThrowsMessage<DataError>(
          AllOf(HasSubstr("grid 'a' is a level set with its inside at +background, and its surface "
                          "is open at voxel "),
                HasSubstr("; close the surface, or fill the signs (signed flood fill) in the tool "
                          "that it comes from"))));
}

TEST_F(ResampleTest, GridsThatAreNotUsedAreNamed) {
  const auto ball = ballInVoxels();
  ball->setTransform(fifths());
  ball->setName("surface");
  openvdb::io::File(path.string()).write(openvdb::GridCPtrVec{ball, ball->deepCopy()});
  const Made one = made({path.string()});
  EXPECT_NEAR(one.mm3, ball_mm3, near_mm3);
  EXPECT_THAT(
      one.warnings,
      ElementsAre("only grid 'surface' is used, not 'surface_2' (float); 'surface_2' is a "
                  "second grid of that name; csg --union joins what resample makes of each"));
  EXPECT_THAT(made({write({{"a", ball}, {"v", openvdb::Vec3SGrid::create()}})}).warnings,
              ElementsAre("only grid 'a' is used, not 'v' (vec3s)"));
  EXPECT_THAT(
      made({write({{"a", ball}, {"v", openvdb::Vec3SGrid::create()}}), "--grid", "a"}).warnings,
      IsEmpty());
}

template <typename GridT>
GridConstPtr voxelsOfBall(typename GridT::ValueType value) {
  const auto grid = GridT::create();
  for (const Coord& ijk : CoordBBox(Coord(-14), Coord(14))) {
    if (ijk.asVec3d().length() < 10) grid->tree().setValueOn(ijk, value);
  }
  grid->setTransform(fifths());
  return grid;
}

TEST_F(ResampleTest, VoxelsAreReadAsTheyAre) {
  for (const GridConstPtr& grid :
       {voxelsOfBall<openvdb::BoolGrid>(true), voxelsOfBall<openvdb::MaskGrid>(true),
        voxelsOfBall<openvdb::Int32Grid>(-7), voxelsOfBall<openvdb::Int64Grid>(1)}) {
    const Made ball = made({write({{"mask", grid}})});
    EXPECT_NEAR(ball.mm3, ball_mm3, near_mm3) << grid->valueType();
    EXPECT_THAT(ball.warnings, IsEmpty()) << grid->valueType();
  }
  const auto labels = openvdb::Int32Grid::create(0);
  labels->sparseFill(CoordBBox(Coord(0), Coord(9)), 0);
  labels->sparseFill(CoordBBox(Coord(0), Coord(4, 9, 9)), 3);
  labels->setTransform(fifths());
  EXPECT_NEAR(made({write({{"labels", labels}})}).mm3, 4, 0.1);
  EXPECT_THAT(planning({{"mask", voxelsOfBall<openvdb::BoolGrid>(true)}}, {"--kind", "level-set"}),
              ThrowsMessage<UsageError>("--kind: grid 'mask' holds voxels and no distances"));
  EXPECT_THAT(planning({{"mask", openvdb::BoolGrid::create(false)}}),
              ThrowsMessage<DataError>(HasSubstr("grid 'mask' has no surface")));
}

TEST_F(ResampleTest, SizesThatNobodyMeansAreAskedAbout) {
  const auto ball = ballInVoxels();
  ball->setTransform(openvdb::math::Transform::createLinearTransform(0.0002));
  EXPECT_THAT(
      made({write({{"a", ball}})}).warnings,
      ElementsAre("the part is 0.004 x 0.004 x 0.004 mm; are the file's numbers m? --unit m "
                  "makes its longest side 3.99 mm"));
  ball->setTransform(openvdb::math::Transform::createLinearTransform(0.04));
  EXPECT_THAT(
      made({write({{"a", ball}})}).warnings,
      ElementsAre("the part is 0.798 x 0.798 x 0.798 mm, fewer than 10 voxels along its "
                  "longest side; are the file's numbers in? --unit in makes its longest side "
                  "20.27 mm"));
}

FloatGrid::Ptr fogOfBall(double ramp_voxels, double greatest) {
  const auto fog = FloatGrid::create(0);
  for (const Coord& ijk : CoordBBox(Coord(-20), Coord(20))) {
    const double depth = 10 - ijk.asVec3d().length();
    if (depth > 0)
      fog->tree().setValueOn(
          ijk, static_cast<float>(greatest * std::clamp(depth / ramp_voxels, 0.0, 1.0)));
  }
  fog->setGridClass(openvdb::GRID_FOG_VOLUME);
  fog->setTransform(fifths());
  return fog;
}

TEST_F(ResampleTest, FogWhoseLevelLiesFarInsideIsAskedAbout) {
  EXPECT_THAT(made({write({{"fog", fogOfBall(1, 1)}})}).warnings, IsEmpty());
  const Made ramp = made({write({{"fog", fogOfBall(4, 1)}})});
  EXPECT_THAT(
      ramp.warnings,
      ElementsAre(AllOf(HasSubstr("grid 'fog' is fog of values up to 1, which begins about "),
                        HasSubstr(" of its voxels, outside its surface at 0.5; if it is solid "
                                  "where it begins, give --level 0.01"))));
  const Made whole = made({write({{"fog", fogOfBall(4, 1)}}), "--level", "0.01"});
  // Between its first voxel and the one before it, the fog may begin anywhere.
  EXPECT_NEAR(whole.mm3, ball_mm3, 3);
  EXPECT_LT(ramp.mm3, 0.7 * ball_mm3);
  EXPECT_THAT(whole.warnings, IsEmpty());
  EXPECT_THAT(made({write({{"fog", fogOfBall(1, 100)}})}).warnings,
              ElementsAre("grid 'fog' is fog of values up to 100, and its surface is taken at 0.5; "
                          "--level 50 is half of that"));
}

/// Colours that tell where they are, in mm, on cubes of 0.3 mm that are turned; active up to
/// `reach_mm` from the origin.
openvdb::Vec3SGrid::Ptr positions(double reach_mm, double unit = 1) {
  const auto grid = openvdb::Vec3SGrid::create();
  const auto transform = openvdb::math::Transform::createLinearTransform(0.3 * unit);
  transform->postRotate(0.4, openvdb::math::X_AXIS);
  grid->setTransform(transform);
  for (const Coord& ijk : CoordBBox(Coord(-12), Coord(12))) {
    const Vec3d at = grid->indexToWorld(ijk) / unit;
    if (at.length() < reach_mm) grid->tree().setValueOn(ijk, openvdb::Vec3s(at));
  }
  return grid;
}

/// Expects in `Cd` the position of each voxel that has a distance and is at most one diameter
/// outside, and nothing elsewhere.
void expectPositions(const Taken& made, const Vec3d& moved = Vec3d(0.0)) {
  const auto surface = openvdb::gridConstPtrCast<FloatGrid>(made.grids.at("surface"));
  const auto colours = openvdb::gridConstPtrCast<openvdb::Vec3SGrid>(made.grids.at("Cd"));
  ASSERT_NE(colours, nullptr);
  EXPECT_EQ(colours->transform(), surface->transform());
  int active = 0;
  for (const Coord& ijk : made.lattice.box) {
    const float distance = surface->tree().getValue(ijk);
    const bool expected = surface->tree().isValueOn(ijk) && distance <= 0.1 * std::sqrt(3);
    ASSERT_EQ(colours->tree().isValueOn(ijk), expected) << ijk << distance;
    const Vec3d at = expected ? made.lattice.position(ijk) - moved : Vec3d(0.0);
    ASSERT_LT((Vec3d(colours->tree().getValue(ijk)) - at).length(), 1e-5) << ijk;
    active += expected;
  }
  EXPECT_GT(active, 1000);
  EXPECT_EQ(static_cast<int>(colours->activeVoxelCount()), active);
}

FloatGrid::Ptr ballInFifths() {
  const auto ball = ballInVoxels();
  ball->setTransform(fifths());
  return ball;
}

TEST_F(ResampleTest, ColoursOfAnotherLatticeAreTakenAlong) {
  const Taken made = taken({write({{"a", ballInFifths()}, {"Cd", positions(3.4)}})});
  expectPositions(made);
  EXPECT_THAT(made.warnings, IsEmpty());
  EXPECT_EQ(made.grids.size(), 2U);
}

TEST_F(ResampleTest, ColoursFollowUnitAndPlace) {
  const auto ball = ballInVoxels();
  ball->setTransform(openvdb::math::Transform::createLinearTransform(0.0002));
  const Grids grids{{"a", ball}, {"Cd", positions(3.4, 0.001)}};
  expectPositions(taken({write(grids), "--unit", "m"}));
  const Taken placed = taken({write(grids), "--unit", "m", "--place"});
  const auto first =
      openvdb::gridConstPtrCast<openvdb::Vec3SGrid>(placed.grids.at("Cd"))->cbeginValueOn();
  const Vec3d moved = placed.lattice.position(first.getCoord()) - Vec3d(*first);
  EXPECT_LT((moved - Vec3d(2 - 0.05)).length(), 0.02);
  expectPositions(placed, moved);
}

TEST_F(ResampleTest, DoublesAndOtherNamesOfOpacityAreTaken) {
  const auto alpha = openvdb::DoubleGrid::create(0);
  alpha->sparseFill(CoordBBox(Coord(-40), Coord(40)), 0.25);
  alpha->setTransform(fifths());
  const auto colours = openvdb::Vec3DGrid::create();
  const auto singles = positions(3.4);
  colours->setTransform(singles->transform().copy());
  for (auto value = singles->cbeginValueOn(); value; ++value)
    colours->tree().setValueOn(value.getCoord(), Vec3d(*value));
  const Taken made = taken({write({{"a", ballInFifths()}, {"alpha", alpha}, {"Cd", colours}})});
  expectPositions(made);
  const auto opacity = openvdb::gridConstPtrCast<FloatGrid>(made.grids.at("Alpha"));
  ASSERT_NE(opacity, nullptr);
  EXPECT_EQ(opacity->activeVoxelCount(), made.grids.at("Cd")->activeVoxelCount());
  for (auto value = opacity->cbeginValueOn(); value; ++value) ASSERT_EQ(*value, 0.25F);
}

TEST_F(ResampleTest, WhereNoNodeIsActiveThereIsNoColour) {
  // Half of the ball has colours; at the border those of the active nodes count alone.
  const auto colours = openvdb::Vec3SGrid::create();
  colours->setTransform(fifths());
  colours->sparseFill(CoordBBox(Coord(-40), Coord(0, 40, 40)), openvdb::Vec3s(0.5));
  const Taken made = taken({write({{"a", ballInFifths()}, {"Cd", colours}})});
  const auto taken_colours = openvdb::gridConstPtrCast<openvdb::Vec3SGrid>(made.grids.at("Cd"));
  const auto surface = openvdb::gridConstPtrCast<FloatGrid>(made.grids.at("surface"));
  int with = 0;
  int without = 0;
  for (auto voxel = surface->cbeginValueOn(); voxel; ++voxel) {
    if (*voxel > 0.1 * std::sqrt(3)) continue;
    const Coord at = voxel.getCoord();
    ASSERT_EQ(taken_colours->tree().isValueOn(at), at.x() < 2) << at;
    const openvdb::Vec3s expected(at.x() < 2 ? 0.5F : 0.0F);
    ASSERT_EQ(taken_colours->tree().getValue(at), expected) << at;
    (at.x() < 2 ? with : without) += 1;
  }
  EXPECT_GT(with, 1000);
  EXPECT_GT(without, 1000);
}

TEST_F(ResampleTest, TakesTheGridsAlongThatItIsTold) {
  const Grids grids{{"a", ballInFifths()}, {"Cd", positions(3.4)}, {"heat", ballInFifths()}};
  const Taken heat = taken({write(grids), "--with", "heat"});
  EXPECT_TRUE(heat.grids.contains("heat"));
  EXPECT_FALSE(heat.grids.contains("Cd"));
  EXPECT_THAT(heat.warnings, ElementsAre("only grid 'a' is used, not 'Cd' (vec3s)"));
  EXPECT_EQ(taken({write(grids), "--grid", "a", "--with", "none"}).grids.size(), 1U);
  EXPECT_THAT(planning(grids, {"--grid", "a", "--with", "cold"}),
              ThrowsMessage<UsageError>(HasSubstr("--with: no grid 'cold' in '")));
  EXPECT_THAT(planning(grids, {"--grid", "a", "--with", "a"}),
              ThrowsMessage<UsageError>("--with: 'a' is the name of the surface"));
}

TEST_F(ResampleTest, RefusesToTakeAlongWhatCannotBeSampled) {
  const auto with = [&](const GridConstPtr& grid) {
    return planning({{"a", ballInFifths()}, {"v", grid}}, {"--grid", "a", "--with", "v"});
  };
  EXPECT_THAT(with(voxelsOfBall<openvdb::BoolGrid>(true)),
              ThrowsMessage<UsageError>(
                  "--with: grid 'v' is of bool, not of float, double, vec3s or vec3d"));
  const auto normals = positions(3.4);
  normals->setVectorType(openvdb::VEC_COVARIANT_NORMALIZE);
  EXPECT_THAT(with(normals), ThrowsMessage<UsageError>(HasSubstr("grid 'v' holds directions (")));
  const auto endless = positions(3.4);
  endless->tree().setValueOn(Coord(0), openvdb::Vec3s(std::nanf("")));
  EXPECT_THAT(with(endless), ThrowsMessage<DataError>(HasSubstr("not a finite number")));
  const Taken left = taken({write({{"a", ballInFifths()}, {"Cd", normals}})});
  EXPECT_FALSE(left.grids.contains("Cd"));
  EXPECT_THAT(left.warnings, testing::Contains(HasSubstr("; it is not taken along")));
}

TEST_F(ResampleTest, ColoursDoNotDependOnTheSlabs) {
  const auto verb = findOperator("resample").make();
  Options options;
  verb->declare(options);
  const std::vector<std::string> arguments{write({{"a", ballInFifths()}, {"Cd", positions(3.4)}}),
                                           "--pitch", "0.1mm,0.1mm,0.1mm"};
  options.parse(arguments);
  auto& source = dynamic_cast<Source&>(*verb);
  const ZRange layers = source.plan().lattice.layers();
  const auto whole = openvdb::gridConstPtrCast<openvdb::Vec3SGrid>(source.run(layers).at("Cd"));
  openvdb::Index64 active = 0;
  for (int begin = layers.begin; begin < layers.end; begin += 8) {
    const ZRange core{begin, std::min(begin + 8, layers.end)};
    const auto piece = openvdb::gridConstPtrCast<openvdb::Vec3SGrid>(source.run(core).at("Cd"));
    for (auto voxel = piece->cbeginValueOn(); voxel; ++voxel, ++active)
      ASSERT_EQ(*voxel, whole->tree().getValue(voxel.getCoord()));
  }
  EXPECT_EQ(active, whole->activeVoxelCount());
}

}  // namespace
}  // namespace vdbdither
