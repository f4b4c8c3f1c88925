#include "ops/kernels/colour/csg_colours.h"

#include <gtest/gtest.h>

#include "tests/support/volumes.h"
#include "vdbdither/model/known_grids.h"

namespace vdbdither {
namespace {

using openvdb::Coord;
using openvdb::FloatGrid;
using openvdb::Vec3d;
using openvdb::Vec3s;
using openvdb::Vec3SGrid;

const Vec3s red(1, 0, 0);
const Vec3s blue(0, 0, 1);

/// Two balls that overlap, each with a shell of one colour.
class CsgColoursTest : public testing::Test {
 protected:
  Vec3SGrid::Ptr shell(const FloatGrid& surface, const Vec3s& colour) const {
    auto grid = Vec3SGrid::create(Vec3s(0, 0, 0));
    grid->setName(colour_grid);
    grid->setTransform(surface.transform().copy());
    for (const Coord& ijk : lattice.box) {
      const float d = surface.tree().getValue(ijk);
      if (d > -0.15F && d < 0.1F) grid->tree().setValueOn(ijk, colour);
    }
    return grid;
  }
  [[nodiscard]] Vec3SGrid::Ptr combinedOf(Csg operation, bool b_first = false) const {
    return combinedValues<Vec3SGrid>(*a, *b, colours_a.get(), colours_b.get(), operation, b_first,
                                     lattice.layers());
  }

  Lattice lattice = test::latticeAround(Vec3d(0.05), Vec3d(1.2), 0.1);
  test::Distance left = test::sphere({-0.4, 0, 0}, 0.6);
  test::Distance right = test::sphere({0.4, 0, 0}, 0.6);
  FloatGrid::Ptr a = test::sampled(left, lattice, 0.2);
  FloatGrid::Ptr b = test::sampled(right, lattice, 0.2);
  Vec3SGrid::Ptr colours_a = shell(*a, red);
  Vec3SGrid::Ptr colours_b = shell(*b, blue);
};

TEST_F(CsgColoursTest, AUnionHasTheColourOfThePartThatAVoxelBelongsTo) {
  for (const bool b_first : {false, true}) {
    const auto grid = combinedOf(Csg::unite, b_first);
    EXPECT_EQ(grid->tree().getValue({-19, 0, 0}), red);
    EXPECT_EQ(grid->tree().getValue({19, 0, 0}), blue);
    // 0.1 mm deep in both.
    EXPECT_EQ(grid->tree().getValue({0, 6, 0}), b_first ? blue : red);
    EXPECT_FALSE(grid->tree().isValueOn({-8, 0, 0})) << "deep inside the left one";
  }
}

TEST_F(CsgColoursTest, AnIntersectionHasTheColourOfTheNearerSurface) {
  const auto grid = combinedOf(Csg::intersect);
  EXPECT_EQ(grid->tree().getValue({3, 0, 0}), red) << "the left ball ends at 0.2 mm";
  EXPECT_EQ(grid->tree().getValue({-3, 0, 0}), blue);
}

TEST_F(CsgColoursTest, ACutHasTheColourOfWhatCuts) {
  const auto grid = combinedOf(Csg::subtract);
  EXPECT_EQ(grid->tree().getValue({-19, 0, 0}), red);
  EXPECT_EQ(grid->tree().getValue({-5, 0, 0}), blue) << "0.05 mm from the right ball";
  EXPECT_FALSE(grid->tree().isValueOn({19, 0, 0}));
}

TEST_F(CsgColoursTest, APartWithoutColoursGivesNone) {
  colours_b.reset();
  const auto grid = combinedOf(Csg::unite);
  EXPECT_EQ(grid->tree().getValue({-19, 0, 0}), red);
  EXPECT_FALSE(grid->tree().isValueOn({19, 0, 0}));
}

TEST_F(CsgColoursTest, LayersOutsideOfTheCoreHaveNone) {
  const auto grid = combinedValues<Vec3SGrid>(*a, *b, colours_a.get(), colours_b.get(), Csg::unite,
                                              false, {-3, 5});
  EXPECT_FALSE(grid->empty());
  for (auto it = grid->cbeginValueOn(); it; ++it)
    ASSERT_TRUE(it.getCoord().z() >= -3 && it.getCoord().z() < 5);
}

}  // namespace
}  // namespace vdbdither
