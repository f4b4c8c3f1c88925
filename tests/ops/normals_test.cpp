#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/filters.h"
#include "vdbdither/model/errors.h"

namespace vdbdither {
namespace {

using openvdb::CoordBBox;
using openvdb::FloatGrid;
using openvdb::Vec3d;
using openvdb::Vec3s;
using openvdb::Vec3SGrid;

const Lattice mimaki = test::latticeAround({0.042, 0.084, 0.022}, Vec3d(0.5), 0.3);

Schema ball() {
  return test::schemaOf(
      mimaki, {{"surface", test::sampled(test::sphere({0.01, 0.02, -0.1}, 0.45), mimaki, 0.2)}});
}

TEST(Normals, AnnouncesAGridThatTransformsAsNormalsDo) {
  const Schema in = ball();
  const GridConstPtr planned = test::filterCalled("normals")->plan(in).grids.at("N");
  EXPECT_EQ(planned->getName(), "N");
  EXPECT_EQ(planned->valueType(), "vec3s");
  EXPECT_EQ(planned->getVectorType(), openvdb::VEC_COVARIANT_NORMALIZE);
  EXPECT_EQ(planned->transform(), in.grids.at("surface")->transform());
}

TEST(Normals, MakesTheSameOfSlabsOfAnyHeightWhateverLiesBeyondItsReach) {
  const auto normals = test::filterCalled("normals");
  const auto whole = openvdb::gridConstPtrCast<Vec3SGrid>(test::runWhole(*normals, ball()).at("N"));
  for (const int height : {8, 16, 64}) {
    openvdb::Index64 active = 0;
    for (const auto& [core, grids] : test::runInSlabs(*normals, ball(), height)) {
      const auto slab = openvdb::gridConstPtrCast<Vec3SGrid>(grids.at("N"));
      for (auto v = slab->cbeginValueOn(); v; ++v) {
        ASSERT_TRUE(core.contains(v.getCoord().z()));
        ASSERT_EQ(*v, whole->tree().getValue(v.getCoord()));
      }
      active += slab->activeVoxelCount();
    }
    EXPECT_EQ(active, whole->activeVoxelCount());
  }
}

TEST(Normals, KeepsThoseThatAreThere) {
  Schema in = ball();
  in.grids["N"] = Vec3SGrid::create(Vec3s(0.0F));
  const auto normals = test::filterCalled("normals");
  EXPECT_EQ(normals->plan(in).grids.at("N"), in.grids.at("N"));
  EXPECT_TRUE(normals->reads().empty());
  EXPECT_TRUE(test::runWhole(*normals, in).empty());
}

TEST(Normals, MakesNothingOfEmptySlabs) {
  const Schema schema = test::schemaOf(mimaki, {{"surface", FloatGrid::create(0.2F)}});
  const Grids out = test::runWhole(*test::filterCalled("normals"), schema);
  EXPECT_TRUE(openvdb::gridConstPtrCast<Vec3SGrid>(out.at("N"))->empty());
}

TEST(Normals, RefusesToRunWithoutASurface) {
  EXPECT_THAT([] { test::filterCalled("normals")->plan(test::schemaOf(mimaki, {})); },
              testing::ThrowsMessage<DataError>("no grid 'surface'; there is none"));
}

}  // namespace
}  // namespace vdbdither
