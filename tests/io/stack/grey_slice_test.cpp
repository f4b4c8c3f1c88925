#include "io/stack/grey_slice.h"

#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "vdbdither/model/half_space_share.h"
#include "vdbdither/model/known_grids.h"

namespace vdbdither {
namespace {

using openvdb::Coord;
using openvdb::CoordBBox;
using openvdb::Vec3d;

const Vec3d pitch_mm(0.014, 0.019, 0.05);

/// The half space under a plane, with the voxels of its inside printed.
struct HalfSpace {
  HalfSpace() : normal(Vec3d(0.3, 0.2, 0.9).unit()) {
    const auto surface = openvdb::FloatGrid::create(0.2F);
    const auto normals = openvdb::Vec3SGrid::create(openvdb::Vec3s(0));
    for (auto voxel = CoordBBox(Coord(-9, -7, 0), Coord(10, 8, 7)).begin(); voxel; ++voxel) {
      surface->tree().setValue(*voxel, static_cast<float>(distance(*voxel)));
      normals->tree().setValue(*voxel, openvdb::Vec3s(normal));
    }
    grids[surface_grid] = surface;
    grids[normal_grid] = normals;
  }
  [[nodiscard]] double distance(const Coord& voxel) const {
    return normal.dot(voxel.asVec3d() * pitch_mm) - 0.16;
  }
  [[nodiscard]] SpanImage printed(const SliceLayout& layout, int z) const {
    SpansBuilder builder(layout.width());
    for (std::uint32_t row = 0; row < layout.height(); ++row) {
      builder.pixel(0, 0);
      for (int i = 0; i < layout.box.dim().x(); ++i) {
        const int x = layout.flip_x ? layout.box.max().x() - i : layout.box.min().x() + i;
        for (int y = layout.box.min().y(); y <= layout.box.max().y(); ++y) {
          if (layout.rowOf(y) == row)
            builder.pixel(layout.columnOf(x), distance(Coord(x, y, z)) < 0 ? 3 : 0);
        }
      }
      if (layout.padding > 0) builder.pixel(layout.width() - layout.padding, 0);
      builder.endRow();
    }
    return builder.finish();
  }
  Vec3d normal;
  Grids grids;
};

std::uint32_t valueAt(const SpanImage& image, std::uint32_t column, std::uint32_t row) {
  for (const Span& span : image.row(row)) {
    if (span.end > column) return span.value;
  }
  return 0;
}

TEST(GreySlice, IsTheShareOfEachVoxelBelowThePlane) {
  const HalfSpace plane;
  const CoordBBox box(Coord(-9, -7, 0), Coord(10, 8, 7));
  for (const SliceLayout& layout :
       {SliceLayout{box, 0, false, false}, SliceLayout{box, 2, true, false},
        SliceLayout{CoordBBox(Coord(-3, -2, 0), Coord(6, 5, 7)), 1, true, true}}) {
    int between = 0;
    for (int z = 0; z < 8; ++z) {
      const SpanImage image = plane.printed(layout, z);
      const SpanImage grey = greySlice({z, "", image, plane.grids}, layout, pitch_mm, std::nullopt);
      for (int x = layout.box.min().x(); x <= layout.box.max().x(); ++x) {
        for (int y = layout.box.min().y(); y <= layout.box.max().y(); ++y) {
          const double share =
              halfSpaceShare(plane.distance(Coord(x, y, z)), plane.normal, pitch_mm);
          const std::uint32_t value = valueAt(grey, layout.columnOf(x), layout.rowOf(y));
          EXPECT_NEAR(value, 255 * share, 0.51);
          between += value > 0 && value < 255;
        }
      }
      if (layout.padding > 0) {
        EXPECT_EQ(valueAt(grey, 0, 0), 0U);
        EXPECT_EQ(valueAt(grey, layout.width() - 1, layout.height() - 1), 0U);
      }
    }
    EXPECT_GT(between, 50);
  }
}

TEST(GreySlice, LevelsFollowTheWorkingCurveOfTheResin) {
  const HalfSpace plane;
  const SliceLayout layout{CoordBBox(Coord(-9, -7, 0), Coord(10, 8, 7)), 0, false, false};
  const SpanImage image = plane.printed(layout, 3);
  const SpanImage linear = greySlice({3, "", image, plane.grids}, layout, pitch_mm, std::nullopt);
  const SpanImage cured = greySlice({3, "", image, plane.grids}, layout, pitch_mm, 8.0);
  int seen = 0;
  for (std::uint32_t x = 0; x < layout.width(); ++x) {
    const std::uint32_t share = valueAt(linear, x, 4);
    const std::uint32_t level = valueAt(cured, x, 4);
    if (share == 0 || share == 255) {
      // The smallest share has the minimum dose that hardens.
      EXPECT_TRUE(level == share || (share == 0 && level == 32));
      continue;
    }
    // The depth of cure follows the logarithm of the dose: 1 at the full dose, 0 at the minimum.
    EXPECT_NEAR(std::log(level / 255.0 * 8) / std::log(8), share / 255.0, 0.01);
    ++seen;
  }
  EXPECT_GT(seen, 3);
}

TEST(GreySlice, FarFromTheSurfaceIsFullWherePrinted) {
  const auto surface = openvdb::FloatGrid::create(0.2F);
  const auto normals = openvdb::Vec3SGrid::create(openvdb::Vec3s(0));
  const Grids grids{{surface_grid, surface}, {normal_grid, normals}};
  const SliceLayout layout{CoordBBox(Coord(0, 0, 0), Coord(3, 1, 0)), 0, false, false};
  SpansBuilder builder(4);
  for (int row = 0; row < 2; ++row) {
    builder.pixel(0, 0);
    builder.pixel(2, 2);
    builder.endRow();
  }
  const SpanImage image = builder.finish();
  const SpanImage grey = greySlice({0, "", image, grids}, layout, pitch_mm, 3.0);
  EXPECT_EQ(valueAt(grey, 1, 0), 0U);
  EXPECT_EQ(valueAt(grey, 2, 1), 255U);
}

}  // namespace
}  // namespace vdbdither
