#include "ops/kernels/contour/inside_signs.h"

#include <cmath>

#include <gtest/gtest.h>
#include <openvdb/tools/Clip.h>
#include <openvdb/tools/LevelSetSphere.h>

namespace vdbdither {
namespace {

using openvdb::Coord;
using openvdb::CoordBBox;
using openvdb::FloatGrid;

/// A ball of `radius` voxels whose voxels within the band alone are set: its inside is at
/// +background. Voxels that `leave_out` names are not set either.
template <typename LeaveOut>
FloatGrid::Ptr bandOfBall(double radius, const LeaveOut& leave_out) {
  openvdb::initialize();
  const auto grid = FloatGrid::create(3);
  const int reach = static_cast<int>(radius) + 4;
  for (const Coord& ijk : CoordBBox(Coord(-reach), Coord(reach))) {
    const double d = ijk.asVec3d().length() - radius;
    if (std::abs(d) < 3 && !leave_out(ijk)) grid->tree().setValue(ijk, static_cast<float>(d));
  }
  grid->setGridClass(openvdb::GRID_LEVEL_SET);
  return grid;
}

bool nowhere(const Coord&) { return false; }

TEST(InsideSigns, ASoundLevelSetComesBackItself) {
  openvdb::initialize();
  const FloatGrid::ConstPtr ball = openvdb::tools::createLevelSetSphere<FloatGrid>(20, {}, 1, 3);
  const SignedLevelSet same = withInsideSigns(ball);
  EXPECT_EQ(same.grid, ball);
  EXPECT_EQ(same.signs, InsideSigns::given);
}

TEST(InsideSigns, AClosedBandIsFilled) {
  for (const double radius : {4.5, 20.0, 70.0}) {
    const FloatGrid::ConstPtr band = bandOfBall(radius, nowhere);
    ASSERT_GT(band->tree().getValue(Coord(0)), 0);
    const SignedLevelSet filled = withInsideSigns(band);
    ASSERT_EQ(filled.signs, InsideSigns::filled) << radius;
    EXPECT_GT(band->tree().getValue(Coord(0)), 0) << "the given grid is not changed";
    const int reach = static_cast<int>(radius) + 4;
    for (int x = -reach; x <= reach; ++x) {
      for (const Coord& ijk : {Coord(x, 0, 0), Coord(1, x, 2), Coord(-3, 0, x)}) {
        EXPECT_EQ(filled.grid->tree().getValue(ijk) < 0, ijk.asVec3d().length() < radius)
            << radius << " " << ijk;
      }
    }
  }
}

TEST(InsideSigns, AnOpenBandIsTold) {
  const auto hole = [](const Coord& ijk) { return ijk.x() > 0 && ijk.y() * ijk.y() < 9; };
  const SignedLevelSet open = withInsideSigns(bandOfBall(20, hole));
  EXPECT_EQ(open.signs, InsideSigns::missing);
}

TEST(InsideSigns, ABackgroundOfZeroSaysNothing) {
  const auto band = bandOfBall(20, nowhere);
  const auto zero = FloatGrid::create(0);
  for (auto value = band->cbeginValueOn(); value; ++value)
    zero->tree().setValue(value.getCoord(), *value);
  EXPECT_EQ(withInsideSigns(zero).signs, InsideSigns::missing);
}

TEST(InsideSigns, ALevelSetThatWasCutStaysAsItIs) {
  openvdb::initialize();
  const auto ball = openvdb::tools::createLevelSetSphere<FloatGrid>(20, {}, 1, 3);
  const FloatGrid::ConstPtr half =
      openvdb::tools::clip(*ball, openvdb::BBoxd({-30, -30, -30}, {0, 30, 30}));
  const SignedLevelSet same = withInsideSigns(half);
  EXPECT_EQ(same.grid, half);
  EXPECT_EQ(same.signs, InsideSigns::given);
}

}  // namespace
}  // namespace vdbdither
