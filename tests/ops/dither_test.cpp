#include <filesystem>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/dither_reference.h"
#include "vdbdither/errors.h"
#include "vdbdither/options.h"
#include "vdbdither/registry.h"

namespace vdbdither {
namespace {

using openvdb::BoolGrid;
using openvdb::Coord;
using openvdb::CoordBBox;
using openvdb::FloatGrid;
using openvdb::Vec3d;
using testing::HasSubstr;
using testing::ThrowsMessage;

struct Verb {
  std::unique_ptr<Operator> op;
  Filter& filter;
};

Verb verb(const std::string& name, const std::vector<std::string>& arguments) {
  auto op = findOperator(name).make();
  Options options;
  op->declare(options);
  options.parse(arguments);
  auto& filter = dynamic_cast<Filter&>(*op);
  return {std::move(op), filter};
}

const Lattice mimaki = test::latticeAround({0.042, 0.084, 0.022}, {0.6, 0.6, 0.6}, 0.3);

Schema ballOn(const Lattice& lattice) {
  return test::schemaOf(
      lattice, {{"surface", test::sampled(test::sphere({0.01, 0.02, -0.1}, 0.55), lattice, 0.2)}});
}

/// Filled slab by slab, each slab only its own layers.
test::Voxels stitched(Filter& filter, const Schema& schema, int height, const Lattice& out,
                      const char* name) {
  test::Voxels voxels(out.box, 0);
  for (const auto& [core, grids] : test::runInSlabs(filter, schema, height)) {
    const auto grid = openvdb::gridConstPtrCast<BoolGrid>(grids.at(name));
    for (auto v = grid->cbeginValueOn(); v; ++v) {
      EXPECT_TRUE(core.contains(v.getBoundingBox().min().z()) &&
                  core.contains(v.getBoundingBox().max().z()));
    }
    CoordBBox layers = out.box;
    layers.min().z() = core.begin;
    layers.max().z() = core.end - 1;
    for (auto v = layers.begin(); v; ++v) voxels[*v] = grid->tree().getValue(*v);
  }
  return voxels;
}

TEST(Dither, MakesTheSameOfSlabsOfAnyHeightWhateverLiesBeyondItsReach) {
  const Schema plain = ballOn(mimaki);
  Schema with_normals = plain;
  with_normals.grids.merge(test::runWhole(verb("normals", {}).filter, plain));
  for (const Schema& schema : {plain, with_normals}) {
    for (const std::string at : {"closest", "foot", "voxel"}) {
      for (const std::string amplitude : {"4", "8"}) {
        const Verb dither =
            verb("dither", {"--mask", "white", "--at", at, "--amplitude", amplitude});
        const auto solid =
            openvdb::gridConstPtrCast<BoolGrid>(test::runWhole(dither.filter, schema).at("solid"));
        const test::Voxels whole = test::dense(*solid, mimaki.box);
        for (const int height : {8, 16, 64}) {
          EXPECT_EQ(
              test::differences(stitched(dither.filter, schema, height, mimaki, "solid"), whole), 0)
              << at << " " << height;
        }
      }
    }
  }
}

}  // namespace
}  // namespace vdbdither
