#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/filters.h"
#include "vdbdither/model/errors.h"

namespace vdbdither {
namespace {

using openvdb::BoolGrid;
using openvdb::Coord;
using openvdb::CoordBBox;
using openvdb::FloatGrid;
using openvdb::Vec3d;
using openvdb::Vec3SGrid;

const Vec3d pitch_mm(0.042, 0.084, 0.022);
const Lattice plain{pitch_mm, Vec3d(0.0), CoordBBox(Coord(-20, -11, -37), Coord(21, 10, 40))};

/// The lattice of twice the rows, which lie a quarter of the plain pitch below and above the plain
/// ones.
Lattice refined() {
  Lattice lattice{pitch_mm * Vec3d(1, 0.5, 1), Vec3d(0, -pitch_mm.y() / 4, 0), plain.box};
  lattice.box.min().y() *= 2;
  lattice.box.max().y() = 2 * lattice.box.max().y() + 1;
  return lattice;
}

const std::vector<test::Distance> shapes{test::sphere({0.013, -0.02, 0.007}, 0.6),
                                         test::box({0.1, 0, 0}, {0.5, 0.45, 0.6}, {12, 25, 31}),
                                         test::torus(Vec3d(0.0), 0.45, 0.2)};

Schema on(const Lattice& lattice, const test::Distance& distance) {
  return test::schemaOf(lattice, {{"surface", test::sampled(distance, lattice, 0.2)}});
}

test::Voxels solidOf(Filter& filter, const Schema& schema) {
  return test::dense(
      *openvdb::gridConstPtrCast<BoolGrid>(test::runWhole(filter, schema).at("solid")), plain.box);
}

/// (11): the shift along y of a slice, in mm.
double shift(int k) { return pitch_mm.y() / 4 * (k % 2 == 0 ? -1 : 1); }

TEST(Interlace, PicksTheRefinedRowAQuarterVoxelBelowOnEvenSlicesAndAboveOnOddOnes) {
  for (const test::Distance& distance : shapes) {
    const auto solid = solidOf(*test::filterCalled("interlace"), on(refined(), distance));
    int inside = 0;
    for (auto v = plain.box.begin(); v; ++v) {
      const Vec3d at = plain.position(*v) + Vec3d(0, shift((*v).z()), 0);
      ASSERT_EQ(solid[*v] != 0, static_cast<float>(distance(at)) < 0) << *v;
      inside += solid[*v];
    }
    EXPECT_GT(inside, 1000);
  }
}

TEST(Interlace, HasHalfTheLeavesOfARefinedLattice) {
  Schema schema = on(refined(), shapes[0]);
  schema.footprint = {12, 100, 80};
  EXPECT_EQ(test::filterCalled("interlace")->plan(schema).footprint, (Footprint{6, 50, 40}));
  schema = on(plain, shapes[0]);
  schema.footprint = {12, 100, 80};
  EXPECT_EQ(test::filterCalled("interlace")->plan(schema).footprint, (Footprint{12, 100, 80}));
}

TEST(Interlace, InterpolatesOnThePlainLattice) {
  for (const test::Distance& distance : shapes) {
    const Schema schema = on(plain, distance);
    const auto d = openvdb::gridConstPtrCast<FloatGrid>(schema.grids.at("surface"));
    const auto solid = solidOf(*test::filterCalled("interlace"), schema);
    int moved = 0;
    for (auto v = plain.box.begin(); v; ++v) {
      const Coord beside = *v + Coord(0, (*v).z() % 2 == 0 ? -1 : 1, 0);
      const double here = d->tree().getValue(*v);
      const bool both = d->tree().isValueOn(*v) && d->tree().isValueOn(beside);
      const double between = both ? 0.75 * here + 0.25 * double{d->tree().getValue(beside)} : here;
      ASSERT_EQ(solid[*v] != 0, between < 0) << *v;
      moved += solid[*v] != (here < 0);
    }
    EXPECT_GT(moved, 50);
  }
}

TEST(Interlace, DrawsAWallInYAsAComb) {
  // A wall whose face lies an eighth of a voxel above a row's centre, seen along x: y to the right,
  // z upwards.
  const test::Distance wall = [](const Vec3d& at) { return at.y() - pitch_mm.y() / 8; };
  for (const Lattice& lattice : {refined(), plain}) {
    const auto solid = solidOf(*test::filterCalled("interlace"), on(lattice, wall));
    std::string picture = "\n";
    for (int k = 2; k >= -2; --k) {
      for (int j = -3; j <= 2; ++j) picture += solid[{0, j, k}] ? '#' : '.';
      picture += '\n';
    }
    EXPECT_EQ(picture, R"(
####..
###...
####..
###...
####..
)");
  }
}

TEST(Interlace, MakesTheSameOfSlabsOfAnyHeightWhateverLiesBeyondItsReach) {
  const auto interlace = test::filterCalled("interlace");
  for (const Lattice& lattice : {refined(), plain}) {
    const Schema schema = on(lattice, shapes[1]);
    const auto whole = solidOf(*interlace, schema);
    for (const int height : {8, 16, 64}) {
      EXPECT_EQ(test::solidOfSlabs(*interlace, schema, height, plain.box), whole) << height;
    }
  }
}

TEST(Interlace, TakesTilesOneByOneWhereTheirPairIsNotInside) {
  const auto surface = FloatGrid::create(0.2F);
  surface->setTransform(transformOf(refined()));
  test::Voxels expected(plain.box, 0);
  const auto putTile = [&](const Coord& origin) {
    surface->tree().addTile(1, origin, -0.2F, false);
    const Coord first(origin.x(), origin.y() / 2, origin.z());
    for (const Coord& v : CoordBBox(first, first.offsetBy(7, 3, 7))) expected[v] = 1;
  };
  putTile({0, 0, 0});     // alone, the lower of its pair
  putTile({8, 8, 0});     // the upper one
  putTile({-8, -16, 0});  // a pair, and two others over it that are none
  putTile({-8, -8, 0});
  putTile({-8, -16, 8});
  putTile({-8, 0, 8});
  EXPECT_EQ(
      solidOf(*test::filterCalled("interlace"), test::schemaOf(refined(), {{"surface", surface}})),
      expected);
}

TEST(Interlace, LeavesTheRefinedLatticeWithTheSolidAlone) {
  Schema in = on(refined(), shapes[0]);
  in.grids["N"] = Vec3SGrid::create();
  const Schema out = test::filterCalled("interlace")->plan(in);
  EXPECT_EQ(out.lattice, plain);
  EXPECT_EQ(out.grids.size(), 1U);
  EXPECT_EQ(out.grids.at("solid")->transform().indexToWorld(Coord(1, 1, 1)), pitch_mm);
}

TEST(Interlace, PassesOnTheGridsOfThePlainLattice) {
  const Schema in = on(plain, shapes[0]);
  const Schema out = test::filterCalled("interlace")->plan(in);
  EXPECT_EQ(out.lattice, plain);
  EXPECT_EQ(out.grids.at("surface"), in.grids.at("surface"));
  EXPECT_EQ(out.grids.at("solid")->transform(), in.grids.at("surface")->transform());
}

TEST(Interlace, MakesNothingOfEmptySlabs) {
  for (const Lattice& lattice : {refined(), plain}) {
    const Schema schema = test::schemaOf(lattice, {{"surface", FloatGrid::create(0.2F)}});
    const Grids out = test::runWhole(*test::filterCalled("interlace"), schema);
    EXPECT_TRUE(openvdb::gridConstPtrCast<BoolGrid>(out.at("solid"))->empty());
  }
}

TEST(Interlace, RefusesALatticeShiftedOtherwise) {
  Lattice shifted = plain;
  shifted.origin_mm.y() = 0.01;
  EXPECT_THAT([&] { test::filterCalled("interlace")->plan(on(shifted, shapes[0])); },
              testing::ThrowsMessage<DataError>(
                  testing::HasSubstr("neither plain nor refined by two in y")));
}

}  // namespace
}  // namespace vdbdither
