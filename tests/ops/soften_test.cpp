#include <cmath>
#include <memory>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "ops/kernels/leaf/held_band.h"
#include "tests/support/contract.h"
#include "tests/support/filters.h"
#include "vdbdither/model/errors.h"

namespace vdbdither {

/// Shown in docs/writing-an-operator.md.
extern const OperatorInfo soften;

namespace {

using openvdb::Coord;
using openvdb::FloatGrid;
using openvdb::Vec3d;
using testing::HasSubstr;
using testing::ThrowsMessage;

const Vec3d pitch_mm(0.042, 0.084, 0.022);
constexpr double band_mm = 0.3;

std::unique_ptr<Filter> madeSoften() {
  return std::unique_ptr<Filter>(&dynamic_cast<Filter&>(*soften.make().release()));
}

Schema boxShape(double band) {
  const Lattice lattice = test::latticeAround(pitch_mm, Vec3d(0.5), 0.4);
  return test::schemaOf(
      lattice, {{"surface", test::sampled(test::box(Vec3d(0.0), Vec3d(0.5)), lattice, band)}});
}

TEST(Soften, TheOperatorThatThePageShowsTakesTheMeanOfSevenDistances) {
  const Schema in = boxShape(band_mm);
  const auto filter = madeSoften();
  const Grids whole = test::runWhole(*filter, in);
  const auto before = openvdb::gridConstPtrCast<FloatGrid>(in.grids.at("surface"));
  const auto after = openvdb::gridConstPtrCast<FloatGrid>(whole.at("surface"));
  EXPECT_NEAR(heldBandMm(*after), band_mm - 0.084, 1e-6);
  int voxels = 0;
  for (auto voxel = in.lattice.box.begin(); voxel; ++voxel) {
    const auto at = [&](int x, int y, int z) {
      return double{before->tree().getValue(*voxel + Coord(x, y, z))};
    };
    if (std::abs(at(0, 0, 0)) >= band_mm - 0.084 - 1e-6) continue;
    const double mean = (at(0, 0, 0) + at(-1, 0, 0) + at(1, 0, 0) + at(0, -1, 0) + at(0, 1, 0) +
                         at(0, 0, -1) + at(0, 0, 1)) /
                        7;
    if (std::abs(mean) >= band_mm - 0.084 - 1e-6) continue;
    ASSERT_NEAR(after->tree().getValue(*voxel), mean, 1e-6) << *voxel;
    ++voxels;
  }
  EXPECT_GT(voxels, 1000);
  EXPECT_LT(after->tree().getValue(Coord(0)), 0) << "the inside stays inside";
}

TEST(Soften, KeepsWhatAFilterPromises) {
  const Schema in = boxShape(band_mm);
  const auto filter = madeSoften();
  filter->plan(in);
  for (const int height : {8, 24})
    EXPECT_EQ(test::firstBreach(*filter, in, in.grids, height), "") << height;
}

TEST(Soften, ErasesTheGridsThatDescribePointsOfTheSurface) {
  Schema in = boxShape(band_mm);
  for (const char* name : {"N", "closest", "part"}) in.grids[name] = in.grids.at("surface");
  const Schema out = madeSoften()->plan(in);
  EXPECT_FALSE(out.grids.contains("N"));
  EXPECT_FALSE(out.grids.contains("closest"));
  EXPECT_TRUE(out.grids.contains("part"));
}

TEST(Soften, RefusesABandTooNarrowForTheDither) {
  EXPECT_THAT([] { madeSoften()->plan(boxShape(0.15)); },
              ThrowsMessage<DataError>(HasSubstr("'soften' needs 0.18")));
}

}  // namespace
}  // namespace vdbdither
