#include "ops/kernels/measure/voxel_components.h"

#include <numeric>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/drawn_grids.h"
#include "tests/support/volumes.h"

namespace vdbdither {
namespace {

using openvdb::BoolGrid;
using openvdb::Coord;
using openvdb::CoordBBox;
using testing::ElementsAre;
using testing::IsEmpty;

VoxelComponents::Counts countsOf(const BoolGrid& grid, const CoordBBox& box) {
  const BitLayout layout(box);
  VoxelComponents components(layout);
  for (const BitLayer& layer : bitLayers(grid, layout, {box.min().z(), box.max().z() + 1}))
    components.add(layer);
  return components.finish();
}

VoxelComponents::Counts countsOf(const std::vector<std::vector<std::string>>& layers) {
  const auto solid = test::solidOf(*test::drawnMaterial(layers));
  return countsOf(*solid, CoordBBox(Coord(0), Coord(static_cast<int>(layers[0][0].size()) - 1,
                                                    static_cast<int>(layers[0].size()) - 1,
                                                    static_cast<int>(layers.size()) - 1)));
}

TEST(VoxelComponents, CornersJoinVoxels) {
  EXPECT_THAT(countsOf({{"1..", "...", "..."}, {"...", ".1.", "..."}}).components, ElementsAre(2));
  EXPECT_THAT(countsOf({{"1.1"}}).components, ElementsAre(1, 1));
  EXPECT_THAT(countsOf({{"11."}, {"..."}, {"..1"}}).components, ElementsAre(2, 1));
}

TEST(VoxelComponents, ARingIsOnePieceHoweverLateItCloses) {
  EXPECT_THAT(countsOf({{"1.1.1"}, {"1.1.1"}, {"11111"}}).components, ElementsAre(11));
}

TEST(VoxelComponents, ACavityIsClosedByFacesAndOpenedByAFace) {
  const std::vector<std::string> full{"111", "111", "111"};
  EXPECT_THAT(countsOf({full, {"111", "1.1", "111"}, full}).cavities, ElementsAre(1));
  // A gap at an edge does not let what is empty out, one at a face does.
  EXPECT_THAT(countsOf({full, {"111", "1.1", "11."}, full}).cavities, ElementsAre(1));
  EXPECT_THAT(countsOf({full, {"111", "1..", "111"}, full}).cavities, IsEmpty());
  EXPECT_THAT(countsOf({full, {"111", "1.1", "111"}, {"111", "1.1", "111"}}).cavities, IsEmpty());
}

TEST(VoxelComponents, CountsAsAFloodFillDoes) {
  const CoordBBox box(Coord(-5, 3, -2), Coord(66, 16, 13));
  for (const double share : {0.05, 0.3, 0.6, 0.93}) {
    const auto grid = BoolGrid::create(false);
    std::mt19937 random(9);
    for (auto ijk = box.begin(); ijk; ++ijk) {
      if (random() < share * 4294967296.0) grid->tree().setValueOn(*ijk, true);
    }
    const VoxelComponents::Counts counts = countsOf(*grid, box);
    const test::Voxels voxels = test::dense(*grid, box);
    EXPECT_EQ(counts.components.size(),
              static_cast<std::size_t>(test::components(voxels, test::Touching::corners)));
    EXPECT_EQ(std::accumulate(counts.components.begin(), counts.components.end(), std::uint64_t{0}),
              grid->activeVoxelCount());
    // What is empty, with the outside all around, which is one piece and no cavity.
    CoordBBox around = box;
    around.expand(1);
    test::Voxels empty(around, 1);
    for (auto ijk = box.begin(); ijk; ++ijk) empty[*ijk] = voxels[*ijk] == 0;
    EXPECT_EQ(counts.cavities.size() + 1,
              static_cast<std::size_t>(test::components(empty, test::Touching::faces)));
  }
}

TEST(VoxelComponents, OfNothingThereAreNone) {
  EXPECT_THAT(countsOf({{"..."}}).components, IsEmpty());
  EXPECT_THAT(VoxelComponents(BitLayout(CoordBBox(Coord(0), Coord(3)))).finish().cavities,
              IsEmpty());
}

}  // namespace
}  // namespace vdbdither
