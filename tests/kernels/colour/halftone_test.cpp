#include "ops/kernels/colour/halftone.h"

#include <cmath>
#include <limits>
#include <map>
#include <numeric>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "ops/kernels/colour/ink_separation.h"
#include "ops/kernels/mask/mask_tile.h"
#include "tests/support/volumes.h"
#include "vdbdither/model/errors.h"

namespace vdbdither {
namespace {

using openvdb::BoolTree;
using openvdb::Coord;
using openvdb::CoordBBox;
using openvdb::FloatGrid;
using openvdb::Int32Tree;
using openvdb::Vec3d;
using testing::ThrowsMessage;

InkSet inks() {
  InkSet set;
  set.inks = {{"white", {}}, {"clear", {}}, {"yellow", {}},
              {"black", {}}, {"cyan", {}},  {"magenta", {}}};
  set.linear_rgb = {{0.9, 0.9, 0.9},    {0.8, 0.8, 0.9}, {0.58, 0.51, 0.01},
                    {0.01, 0.01, 0.01}, {0, 0.1, 0.34},  {0.38, 0.02, 0.12}};
  set.clear = 1;
  return set;
}

constexpr ZRange all{-1000, 1000};

ThresholdMask smallMask(const Coord& size) {
  VoidAndCluster settings = halftoneMask({0.042, 0.084, 0.014}, 1);
  settings.size = size;
  return ThresholdMask(*maskOf(settings));
}

FloatGrid::Ptr constant(const CoordBBox& box, float value) {
  auto grid = FloatGrid::create(0);
  grid->tree().fill(box, value, true);
  return grid;
}

std::map<std::int32_t, int> counts(const Int32Tree& material, const CoordBBox& box) {
  std::map<std::int32_t, int> found;
  for (auto ijk = box.begin(); ijk; ++ijk) ++found[material.getValue(*ijk)];
  return found;
}

TEST(Halftone, CoverageIsExactToOneVoxelInATile) {
  const Coord size(16, 8, 32);
  const CoordBBox tile(Coord(-16, 8, 32), Coord(-16, 8, 32) + size.offsetBy(-1));
  const CoordBBox around(Coord(-24, 0, 16), Coord(15, 31, 79));
  BoolTree solid(false);
  solid.fill(around, true, true);
  const Halftone halftone(darkestFirst(inks()), smallMask(size));
  const std::vector<float> wanted = {0.41F, 0.07F, 0.02F, 0.1F, 0.37F, 0.03F};
  std::vector<FloatGrid::Ptr> grids;
  std::vector<GridCoverages::Grid> columns;
  for (std::size_t ink = 0; ink < wanted.size(); ++ink) {
    grids.push_back(constant(around, wanted[ink]));
    columns.push_back({grids.back().get(), "coverage", ink});
  }
  const auto material = halftone.run(solid, GridCoverages(columns, std::nullopt), 1, all);
  const auto found = counts(*material, tile);
  constexpr float voxels = 16 * 8 * 32;
  ASSERT_EQ(found.size(), wanted.size());  // none is empty, none is another
  for (std::size_t ink = 0; ink < wanted.size(); ++ink)
    EXPECT_NEAR(found.at(static_cast<std::int32_t>(ink) + 1), voxels * wanted[ink], 1);
}

TEST(Halftone, PrintsTheSolidAndNothingElse) {
  BoolTree solid(false);
  solid.fill(CoordBBox(Coord(-3, 2, 1), Coord(70, 20, 33)), true, true);
  const auto cyan = constant(CoordBBox(Coord(-20), Coord(12)), 1);
  const Halftone halftone(darkestFirst(inks()), smallMask(Coord(8)));
  const auto material =
      halftone.run(solid, GridCoverages({{cyan.get(), "cyan", 4}}, std::nullopt), 1, all);
  const CoordBBox box(Coord(-24), Coord(80, 40, 40));
  for (auto ijk = box.begin(); ijk; ++ijk) {
    const bool printed = solid.isValueOn(*ijk);
    ASSERT_EQ(material->isValueOn(*ijk), printed) << *ijk;
    const std::int32_t wanted = !printed ? 0 : cyan->tree().isValueOn(*ijk) ? 5 : 1;
    ASSERT_EQ(material->getValue(*ijk), wanted) << *ijk;
  }
}

TEST(Halftone, IsCutAtTheLayersAskedFor) {
  BoolTree solid(false);
  solid.fill(CoordBBox(Coord(0), Coord(40, 40, 60)), true, true);
  const auto cyan = constant(CoordBBox(Coord(0), Coord(12, 40, 60)), 1);
  const Halftone halftone(darkestFirst(inks()), smallMask(Coord(8)));
  const auto material =
      halftone.run(solid, GridCoverages({{cyan.get(), "cyan", 4}}, std::nullopt), 1, {13, 27});
  CoordBBox box;
  ASSERT_TRUE(material->evalActiveVoxelBoundingBox(box));
  EXPECT_EQ(box, CoordBBox(Coord(0, 0, 13), Coord(40, 40, 26)));
  EXPECT_EQ(material->activeVoxelCount(), 41U * 41 * 14);
}

TEST(Halftone, AnInkWithoutCoverageIsNeverPrinted) {
  BoolTree solid(false);
  const CoordBBox box(Coord(0), Coord(15));
  solid.fill(box, true, true);
  const Halftone halftone(darkestFirst(inks()), smallMask(Coord(16)));
  // The sum of the others stays below 1 in single precision.
  std::vector<FloatGrid::Ptr> grids;
  std::vector<GridCoverages::Grid> columns;
  for (const std::size_t ink : {2, 3, 4}) {
    grids.push_back(constant(box, 1.0F / 3));
    columns.push_back({grids.back().get(), "coverage", ink});
  }
  const auto found =
      counts(*halftone.run(solid, GridCoverages(columns, std::nullopt), 1, all), box);
  EXPECT_EQ(found.size(), 3U);
  EXPECT_EQ(found.count(1), 0U);
}

TEST(Halftone, TheDarkestInksAreThoseBelowAThreshold) {
  const ThresholdMask mask = smallMask(Coord(8, 8, 16));
  BoolTree solid(false);
  const CoordBBox box(Coord(0), Coord(7, 7, 15));
  solid.fill(box, true, true);
  const auto black = constant(box, 0.2F);
  const auto cyan = constant(box, 0.3F);
  const auto white = constant(box, 0.5F);
  const GridCoverages source(
      {{white.get(), "white", 0}, {black.get(), "black", 3}, {cyan.get(), "cyan", 4}},
      std::nullopt);
  const auto material = Halftone(darkestFirst(inks()), mask).run(solid, source, 1, all);
  for (auto ijk = box.begin(); ijk; ++ijk) {
    const std::int32_t wanted = mask(*ijk) < 0.2F ? 4 : mask(*ijk) < 0.5F ? 5 : 1;
    ASSERT_EQ(material->getValue(*ijk), wanted);
  }
}

TEST(Halftone, ThresholdsBelowTheSurfaceAreThoseOfPlacesInColumns) {
  const ThresholdMask mask = smallMask(Coord(8, 8, 16));
  const openvdb::Vec3d pitch_mm(0.042, 0.084, 0.014);
  const Lattice lattice = test::latticeAround(pitch_mm, Vec3d(0.6), 0.2);
  const auto surface = test::sampled(test::sphere(Vec3d(0.01, 0, 0), 0.5), lattice, 0.3);
  BoolTree solid(false);
  for (auto ijk = lattice.box.begin(); ijk; ++ijk)
    if (surface->tree().getValue(*ijk) < 0) solid.setValueOn(*ijk, true);
  const SurfaceColumns columns(surface->tree(), solid, pitch_mm, 0.15, all);
  SurfaceColumns::Reader places(columns);
  const auto black = constant(lattice.box, 0.4F);
  const auto white = constant(lattice.box, 0.6F);
  const GridCoverages source({{white.get(), "white", 0}, {black.get(), "black", 3}}, std::nullopt);
  const auto material = Halftone(darkestFirst(inks()), mask).run(solid, source, 1, all, &columns);
  int counted = 0;
  for (auto voxel = solid.cbeginValueOn(); voxel; ++voxel) {
    const Coord ijk = voxel.getCoord();
    places.visit(ijk & ~7);
    const unsigned offset = BoolTree::LeafNodeType::coordToOffset(ijk);
    const bool counts = places.isInColumn(offset);
    counted += counts ? 1 : 0;
    const float threshold = mask(counts ? places.place(offset) : ijk);
    ASSERT_EQ(material->getValue(ijk), threshold < 0.4F ? 4 : 1) << ijk;
  }
  EXPECT_GT(counted, 1000);
}

TEST(Halftone, WhatIsNotOpaqueIsClear) {
  const InkSet set = inks();
  const InkSeparation separation(set);
  const CoordBBox box(Coord(0), Coord(15));
  const auto colour = openvdb::Vec3SGrid::create();
  colour->tree().fill(box, openvdb::Vec3s(0.3F), true);
  const auto opacity = constant(box, 0.25F);
  BoolTree solid(false);
  solid.fill(box, true, true);
  const Halftone halftone(darkestFirst(set), smallMask(Coord(16)));
  const auto clear = [&](const FloatGrid* grid) {
    return counts(*halftone.run(solid, ColourCoverages(*colour, grid, set, separation), 1, all),
                  box)[2];
  };
  EXPECT_EQ(clear(opacity.get()), 0.75 * 4096);
  EXPECT_EQ(clear(nullptr), 0);
}

TEST(DarkestFirst, OrdersByLuminanceWithTheClearInkBeforeTheLightest) {
  EXPECT_EQ(darkestFirst(inks()), (std::vector<std::size_t>{3, 4, 5, 2, 1, 0}));
}

TEST(GridCoverages, DividesBySumOrGivesTheRestToAMaterial) {
  const auto read = [](float black, std::optional<std::size_t> rest) {
    const auto grid = constant(CoordBBox(Coord(0), Coord(0)), black);
    const auto reader = GridCoverages({{grid.get(), "density", 1}}, rest).reader();
    std::vector<float> coverages(3);
    EXPECT_TRUE(reader->visit(Coord(0)));
    EXPECT_EQ(reader->layersWith(0), 1U);
    EXPECT_EQ(reader->read(0, 1, coverages), 1U);
    return coverages;
  };
  EXPECT_EQ(read(0.25F, std::nullopt), (std::vector<float>{0, 1, 0}));
  EXPECT_EQ(read(0.25F, 2), (std::vector<float>{0, 0.25F, 0.75F}));
  EXPECT_EQ(read(3, 2), (std::vector<float>{0, 1, 0}));
}

TEST(GridCoverages, RefusesWhatIsNoCoverage) {
  const auto refusal = [](float value) {
    const auto grid = constant(CoordBBox(Coord(1, 2, 3), Coord(1, 2, 3)), value);
    const auto reader = GridCoverages({{grid.get(), "ink", 0}}, std::nullopt).reader();
    std::vector<float> coverages(1);
    reader->visit(Coord(0));
    reader->read(openvdb::FloatTree::LeafNodeType::coordToOffset(Coord(1, 2, 0)), 1U << 3,
                 coverages);
  };
  const std::string advice = " at voxel [1, 2, 3]; coverages must be finite and not negative";
  EXPECT_THAT([&] { refusal(-0.5F); }, ThrowsMessage<DataError>("grid 'ink' is -0.5" + advice));
  EXPECT_THAT([&] { refusal(std::nanf("")); },
              ThrowsMessage<DataError>("grid 'ink' is nan" + advice));
  EXPECT_THAT([&] { refusal(0); },
              ThrowsMessage<DataError>("the coverages are all 0 at voxel [1, 2, 3]; name the "
                                       "material of such voxels (--rest), or mend the grids"));
}

TEST(ColourCoverages, RefusesColoursThatAreNotNumbers) {
  const InkSet set = inks();
  const InkSeparation separation(set);
  const auto colour = openvdb::Vec3SGrid::create();
  colour->tree().setValue(Coord(4, 0, 9),
                          openvdb::Vec3s(0, std::numeric_limits<float>::infinity(), 0));
  BoolTree solid(false);
  solid.setValueOn(Coord(4, 0, 9), true);
  const Halftone halftone(darkestFirst(set), smallMask(Coord(8)));
  EXPECT_THAT(
      [&] {
        (void)halftone.run(solid, ColourCoverages(*colour, nullptr, set, separation), 1, all);
      },
      ThrowsMessage<DataError>(
          "grid 'Cd' has a colour that is not a number at voxel [4, 0, 9]; mend the grid"));
}

TEST(CoverageGrids, HaveTheVoxelsOfTiles) {
  const InkSet set = inks();
  const InkSeparation separation(set);
  const auto colour = openvdb::Vec3SGrid::create();
  colour->tree().addTile(1, Coord(8, 0, 0), openvdb::Vec3s(0.3F), true);
  const auto grids =
      coverageGrids(*colour, ColourCoverages(*colour, nullptr, set, separation), 6, {2, 8});
  for (const auto& grid : grids) EXPECT_EQ(grid->activeVoxelCount(), 8U * 8 * 6);
}

TEST(CoverageGrids, HoldWhatTheHalftoneReads) {
  const InkSet set = inks();
  const InkSeparation separation(set);
  const auto colour = openvdb::Vec3SGrid::create();
  for (int n = 0; n < 200; ++n)
    colour->tree().setValue(Coord(n % 13, n / 13, n % 31),
                            openvdb::Vec3s(static_cast<float>(n % 7) / 7, 0.4F, 0.2F));
  const auto grids =
      coverageGrids(*colour, ColourCoverages(*colour, nullptr, set, separation), 6, {3, 27});
  ASSERT_EQ(grids.size(), 6U);
  std::vector<float> coverages(6);
  for (auto voxel = colour->cbeginValueOn(); voxel; ++voxel) {
    const bool within = voxel.getCoord().z() >= 3 && voxel.getCoord().z() < 27;
    separation.run(*voxel, coverages);
    for (std::size_t ink = 0; ink < 6; ++ink) {
      ASSERT_EQ(grids[ink]->tree().isValueOn(voxel.getCoord()), within);
      ASSERT_EQ(grids[ink]->tree().getValue(voxel.getCoord()), within ? coverages[ink] : 0);
    }
  }
}

}  // namespace
}  // namespace vdbdither
