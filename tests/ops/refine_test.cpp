#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/filters.h"
#include "vdbdither/model/errors.h"

namespace vdbdither {
namespace {

using openvdb::BoolGrid;
using openvdb::FloatGrid;
using openvdb::Vec3d;
using testing::ThrowsMessage;

const Lattice mimaki = test::latticeAround({0.042, 0.084, 0.022}, {0.6, 0.6, 0.6}, 0.3);

test::Voxels voxelsOf(const Grids& grids) {
  return test::dense(*openvdb::gridConstPtrCast<BoolGrid>(grids.at("solid")), mimaki.box);
}

Schema ball() {
  return test::schemaOf(
      mimaki, {{"surface", test::sampled(test::sphere({0.01, 0.02, -0.1}, 0.55), mimaki, 0.2)}});
}

TEST(Refine, AfterDitherIsTheSameAsWithin) {
  Schema schema = ball();
  const auto within =
      voxelsOf(test::runWhole(*test::filterCalled("dither", {"--refine", "2"}), schema));
  schema.grids["solid"] = test::runWhole(*test::filterCalled("dither"), schema).at("solid");
  const auto before = voxelsOf(schema.grids);
  const auto after = voxelsOf(test::runWhole(*test::filterCalled("refine"), schema));
  EXPECT_EQ(after, within);
  EXPECT_GT(test::differences(before, after), 100);
}

TEST(Refine, RefinesWhatTheMaskPrintsToo) {
  Schema schema = ball();
  schema.grids["solid"] =
      test::runWhole(*test::filterCalled("dither", {"--mask", "white"}), schema).at("solid");
  const auto before = voxelsOf(schema.grids);
  EXPECT_GT(
      test::differences(before, voxelsOf(test::runWhole(*test::filterCalled("refine"), schema))),
      500);
}

TEST(Refine, NeedsASurfaceASolidAndABand) {
  const Schema plain = ball();
  EXPECT_THAT([&] { test::filterCalled("refine")->plan(plain); },
              ThrowsMessage<DataError>("no grid 'solid'; there is 'surface'"));
  const Schema thin = test::schemaOf(
      mimaki, {{"surface", FloatGrid::create(0.09F)}, {"solid", BoolGrid::create(false)}});
  EXPECT_THAT([&] { test::filterCalled("refine")->plan(thin); },
              ThrowsMessage<DataError>("grid 'surface' holds distances up to 0.09 mm, and "
                                       "'refine' needs 0.0965 mm: widen --band of mesh2sdf or "
                                       "resample by 0.007 mm"));
  EXPECT_THROW(test::filterCalled("refine", {"--sweeps", "0"}), UsageError);
}

}  // namespace
}  // namespace vdbdither
