#include "io/stack/slice_spans.h"

#include <random>

#include <gtest/gtest.h>

#include "tests/support/span_images.h"

namespace vdbdither {
namespace {

using openvdb::BoolGrid;
using openvdb::Coord;
using openvdb::CoordBBox;
using openvdb::Int32Grid;

/// Values of the pixels of a picture, row by row, a digit each.
std::string drawn(const SpanImage& image) {
  std::string text;
  for (std::uint32_t y = 0; y < image.height; ++y) {
    std::uint32_t x = 0;
    for (const Span& span : image.row(y)) {
      EXPECT_LT(x, span.end);
      for (; x < span.end; ++x) text += static_cast<char>('0' + span.value);
    }
    EXPECT_EQ(x, image.width);
    text += '\n';
  }
  return text;
}

/// The definition, voxel by voxel.
template <typename Grid>
std::string expected(const Grid& grid, const SliceLayout& layout, int z) {
  std::string text;
  const CoordBBox& box = layout.box;
  for (int row = 0; row < static_cast<int>(layout.height()); ++row) {
    for (int column = 0; column < static_cast<int>(layout.width()); ++column) {
      const int x = layout.flip_x ? box.max().x() - (column - layout.padding)
                                  : box.min().x() + column - layout.padding;
      const int y = layout.flip_y ? box.min().y() + row - layout.padding
                                  : box.max().y() - (row - layout.padding);
      const Coord at(x, y, z);
      const bool shown = box.isInside(Coord(x, y, box.min().z()));
      text += static_cast<char>('0' + (shown ? static_cast<int>(grid.tree().getValue(at)) : 0));
    }
    text += '\n';
  }
  return text;
}

template <typename Grid>
void expectShowsEveryVoxel(const Grid& grid, const CoordBBox& box, ZRange layers) {
  for (int i = 0; i < 8; ++i) {
    const SliceLayout layout{box, i & 4 ? 3 : 0, (i & 1) != 0, (i & 2) != 0};
    const std::vector<SpanImage> images = sliceSpans(grid, layout, layers);
    ASSERT_EQ(images.size(), static_cast<std::size_t>(layers.size()));
    for (int z = layers.begin; z < layers.end; ++z) {
      const SpanImage& image = images[z - layers.begin];
      ASSERT_EQ(drawn(image), expected(grid, layout, z)) << "layer " << z;
      for (std::uint32_t y = 0; y < image.height; ++y) {
        for (std::size_t span = 1; span < image.row(y).size(); ++span) {
          ASSERT_NE(image.row(y)[span].value, image.row(y)[span - 1].value)
              << "a span ends without need";
        }
      }
    }
  }
}

TEST(SliceSpans, ShowTheGreatestYOnTop) {
  auto grid = Int32Grid::create(0);
  grid->tree().setValue(Coord(1, 0, 5), 1);
  grid->tree().setValue(Coord(2, 1, 5), 2);
  const SliceLayout layout{CoordBBox(Coord(0, 0, 0), Coord(3, 1, 7)), 0, false, false};
  EXPECT_EQ(drawn(sliceSpans(*grid, layout, {5, 6})[0]),
            "0020\n"
            "0100\n");
}

TEST(SliceSpans, ShowEveryVoxelOfNoiseTilesAndEmptySpace) {
  std::mt19937 random(1);
  auto grid = Int32Grid::create(0);
  const CoordBBox box(Coord(-37, -11, -9), Coord(300, 20, 14));
  grid->fill(CoordBBox(Coord(-16, -8, -8), Coord(23, 15, 7)), 3);
  grid->fill(CoordBBox(Coord(128, 0, 0), Coord(255, 127, 127)), 4);
  for (int i = 0; i < 4000; ++i) {
    const Coord at(-37 + static_cast<int>(random() % 150), -11 + static_cast<int>(random() % 32),
                   -9 + static_cast<int>(random() % 24));
    grid->tree().setValue(at, static_cast<int>(random() % 3));
  }
  grid->tree().prune();
  expectShowsEveryVoxel(*grid, box, {-9, 15});
  expectShowsEveryVoxel(*grid, box, {-3, 2});
}

TEST(SliceSpans, AreCutAtTheBox) {
  auto grid = Int32Grid::create(0);
  grid->fill(CoordBBox(Coord(-100), Coord(100)), 1);
  expectShowsEveryVoxel(*grid, CoordBBox(Coord(-3, 5, -1), Coord(12, 9, 2)), {-1, 3});
}

TEST(SliceSpans, OfASetShowWhatIsActiveAndTrue) {
  std::mt19937 random(2);
  auto grid = BoolGrid::create(false);
  grid->fill(CoordBBox(Coord(0, 0, 0), Coord(31, 15, 15)), true);
  for (int i = 0; i < 2000; ++i) {
    const Coord at(static_cast<int>(random() % 64), static_cast<int>(random() % 16),
                   static_cast<int>(random() % 16));
    const bool on = random() % 2 != 0;
    grid->tree().setActiveState(at, on);
    grid->tree().setValueOnly(at, on);
  }
  expectShowsEveryVoxel(*grid, CoordBBox(Coord(0, 0, 0), Coord(63, 15, 15)), {0, 16});
}

TEST(SliceSpans, ExpandABoxByWhatIsPrintedAndNoFurther) {
  std::mt19937 random(3);
  for (int round = 0; round < 100; ++round) {
    const int width = 1 + static_cast<int>(random() % 9);
    const auto sparse = static_cast<std::uint32_t>(1 + random() % 20);
    const SpanImage image =
        test::spanImage(width, 5, [&](int, int) { return random() % sparse == 0 ? 2U : 0U; });
    CoordBBox expected;
    for (std::uint32_t y = 0; y < image.height; ++y) {
      std::uint32_t x = 0;
      for (const Span& span : image.row(y)) {
        for (; x < span.end; ++x) {
          if (span.value != 0) expected.expand({static_cast<int>(x), static_cast<int>(y), 7});
        }
      }
    }
    CoordBBox box;
    expandByPrinted(box, image, 7);
    EXPECT_EQ(box, expected);
  }
}

}  // namespace
}  // namespace vdbdither
