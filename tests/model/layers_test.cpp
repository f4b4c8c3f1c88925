#include "vdbdither/model/layers.h"

#include <random>

#include <gtest/gtest.h>

#include "vdbdither/model/errors.h"
#include "vdbdither/model/openvdb.h"

namespace vdbdither {
namespace {

using openvdb::Coord;
using openvdb::CoordBBox;
using openvdb::FloatGrid;

const CoordBBox everything{Coord(-40, -40, -40), Coord(40, 40, 40)};

/// Voxels, leaf tiles and larger tiles, some across layer boundaries.
FloatGrid::Ptr mixedGrid() {
  const auto grid = FloatGrid::create(5);
  std::mt19937 random(7);
  std::uniform_int_distribution<int> at(-40, 40);
  for (int i = 0; i < 3000; ++i) {
    grid->tree().setValue({at(random), at(random), at(random)}, static_cast<float>(at(random)));
  }
  grid->sparseFill(CoordBBox({-16, -16, -24}, {15, 15, 23}), -5, false);
  grid->sparseFill(CoordBBox({16, 0, -30}, {31, 7, 30}), 2, true);
  grid->tree().addTile(2, {128, 0, 0}, -5, false);
  return grid;
}

void expectSameVoxels(const FloatGrid& a, const FloatGrid& b, const CoordBBox& box) {
  const auto read_a = a.getConstAccessor();
  const auto read_b = b.getConstAccessor();
  for (auto at = box.beginXYZ(); at; ++at) {
    ASSERT_EQ(read_a.getValue(*at), read_b.getValue(*at)) << *at;
    ASSERT_EQ(read_a.isValueOn(*at), read_b.isValueOn(*at)) << *at;
  }
}

FloatGrid::ConstPtr join(const std::vector<GridLayers>& pieces, ZRange wanted) {
  return openvdb::gridConstPtrCast<FloatGrid>(joinLayers(pieces, wanted));
}

TEST(Layers, CutOutAndJoinedAgainAreTheVoxelsTheyWere) {
  const FloatGrid::ConstPtr whole = mixedGrid();
  const ZRange all{-128, 256};
  std::vector<GridLayers> pieces;
  for (const ZRange part : {ZRange{-128, -16}, ZRange{-16, 8}, ZRange{8, 24}, ZRange{24, 256}}) {
    const GridLayers source{whole, all};
    pieces.push_back({joinLayers({&source, 1}, part), part});
  }
  expectSameVoxels(*join(pieces, all), *whole, everything);
  EXPECT_EQ(join(pieces, all)->tree().getValue({200, 100, 100}), -5);
}

TEST(Layers, NothingRemainsOutsideTheRange) {
  const FloatGrid::ConstPtr whole = mixedGrid();
  const GridLayers source{whole, {-128, 256}};
  const FloatGrid::ConstPtr cut =
      openvdb::gridConstPtrCast<FloatGrid>(joinLayers({&source, 1}, {-13, 11}));
  for (auto at = everything.beginXYZ(); at; ++at) {
    if ((*at).z() >= -13 && (*at).z() < 11) {
      ASSERT_EQ(cut->tree().getValue(*at), whole->tree().getValue(*at)) << *at;
    } else {
      ASSERT_EQ(cut->tree().getValue(*at), 5) << *at;
      ASSERT_FALSE(cut->tree().isValueOn(*at)) << *at;
    }
  }
}

TEST(Layers, APieceThatIsAllOfTheResultIsNotCopied) {
  const GridConstPtr whole = mixedGrid();
  const GridLayers source{whole, {0, 8}};
  EXPECT_EQ(joinLayers({&source, 1}, {0, 8}), whole);
  EXPECT_EQ(joinLayers({&source, 1}, {-8, 16}), whole);
}

TEST(Layers, PrunedTopologyDependsOnTheVoxelsAlone) {
  const auto tiles = FloatGrid::create(5);
  tiles->sparseFill(CoordBBox({0, 0, 0}, {15, 15, 15}), 1, true);
  const auto voxels = FloatGrid::create(5);
  voxels->denseFill(CoordBBox({0, 0, 0}, {15, 15, 15}), 1, true);
  EXPECT_GT(voxels->tree().leafCount(), 0U);
  const auto canonical = openvdb::gridConstPtrCast<FloatGrid>(pruned(voxels));
  EXPECT_EQ(canonical->tree().leafCount(), 0U);
  EXPECT_TRUE(canonical->tree().hasSameTopology(
      openvdb::gridConstPtrCast<FloatGrid>(pruned(tiles))->tree()));
}

TEST(Layers, CarriesEveryGridTypeOfTheConventions) {
  const std::vector<openvdb::GridBase::Ptr> grids{
      openvdb::BoolGrid::create(false), openvdb::Int32Grid::create(0),
      openvdb::Vec3SGrid::create(openvdb::Vec3s(0.0F)), openvdb::DoubleGrid::create(1)};
  for (const GridConstPtr grid : grids) {
    const std::vector<GridLayers> pieces{{grid, {0, 8}}, {grid, {8, 16}}};
    EXPECT_EQ(joinLayers(pieces, {0, 16})->type(), grid->type());
  }
}

TEST(Layers, PointsAreRefused) {
  const GridConstPtr points = openvdb::points::PointDataGrid::create();
  const std::vector<GridLayers> pieces{{points, {0, 8}}, {points, {8, 16}}};
  EXPECT_THROW(joinLayers(pieces, {0, 16}), DataError);
}

}  // namespace
}  // namespace vdbdither
