#include <cmath>
#include <functional>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "io/vdb/vdb.h"
#include "tests/support/scratch_folder.h"
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
using testing::HasSubstr;
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
              ThrowsMessage<DataError>("grid 'v' is of vec3s, not of float or double"));
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
                ThrowsMessage<DataError>("grid 'ball' holds values that are not finite numbers"));
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

}  // namespace
}  // namespace vdbdither
