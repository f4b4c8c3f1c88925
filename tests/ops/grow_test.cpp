#include <memory>

#include <gtest/gtest.h>

#include "tests/support/contract.h"
#include "tests/support/drawn_grids.h"
#include "tests/support/filters.h"

namespace vdbdither {

/// Of docs/writing-an-operator.md.
extern const OperatorInfo grow;

namespace {

using openvdb::Coord;
using openvdb::CoordBBox;

TEST(Grow, TheOperatorThatThePageShowsAddsLayersAndKeepsWhatAFilterPromises) {
  const auto solid = openvdb::BoolGrid::create(false);
  solid->setName("solid");
  solid->tree().sparseFill(CoordBBox(Coord(1, 2, 3), Coord(20, 11, 22)), true);
  const Schema in =
      test::schemaOf({{1, 1, 1}, {0, 0, 0}, CoordBBox(Coord(0), Coord(31))}, {{"solid", solid}});
  const auto made = grow.make();
  Options options;
  made->declare(options);
  options.parse(std::vector<std::string>{"--layers", "5"});
  auto& filter = static_cast<Filter&>(*made);
  const Grids whole = test::runWhole(filter, in);
  const auto grown = openvdb::gridConstPtrCast<openvdb::BoolGrid>(whole.at("solid"));
  EXPECT_EQ(grown->evalActiveVoxelBoundingBox(), CoordBBox(Coord(1, 2, 3), Coord(20, 11, 27)));
  EXPECT_EQ(grown->activeVoxelCount(), 20U * 10U * 25U);
  for (const int height : {8, 16}) EXPECT_EQ(test::firstBreach(filter, in, whole, height), "");
}

}  // namespace
}  // namespace vdbdither
