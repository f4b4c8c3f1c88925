#include "ops/kernels/distance/closest_surface_voxel.h"

#include <random>

#include <gtest/gtest.h>

#include "tests/support/dither_reference.h"

namespace vdbdither {
namespace {

using openvdb::Coord;
using openvdb::CoordBBox;
using openvdb::FloatGrid;
using openvdb::FloatTree;
using openvdb::Vec3d;

/// ∂V of a tree as a set, and as what the search walks over.
FloatTree surfaceVoxelTree(const FloatTree& surface, ZRange valid) {
  FloatTree marked(0.0F);
  SurfaceVoxels surface_voxels(surface, valid);
  for (const FloatLeaf* leaf : leavesIn(surface, valid)) {
    forEachBit(surface_voxels(*leaf),
               [&](unsigned n) { marked.setValueOn(leaf->offsetToGlobalCoord(n), 1.0F); });
  }
  return marked;
}

/// Fails where the search and the brute force differ for a voxel of `box`.
void compareWithBruteForce(const FloatTree& marked, const std::vector<Coord>& listed,
                           const CoordBBox& box, const Vec3d& pitch_mm, double radius_mm) {
  const SearchDisk disk(pitch_mm, radius_mm);
  ClosestSurfaceVoxel closest(marked, disk);
  int found = 0;
  for (auto v = box.begin(); v; ++v) {
    const auto expected = test::closestSurfaceVoxel(listed, *v, pitch_mm, radius_mm);
    const bool near = closest.visit(*v & ~7);
    const auto actual = near ? closest(FloatLeaf::coordToOffset(*v)) : std::nullopt;
    ASSERT_EQ(expected.has_value(), actual.has_value()) << *v;
    if (!expected) continue;
    ++found;
    ASSERT_EQ(*expected, actual->ijk) << "from " << *v;
    ASSERT_EQ(marked.getValue(*expected), actual->value);
  }
  EXPECT_GT(found, 0);
}

TEST(SurfaceVoxels, AreTheVoxelsInsideWithAFaceNeighbourOutside) {
  for (const Vec3d& pitch_mm : test::testPitches()) {
    for (const test::TestShape& shape : test::testShapes()) {
      const Lattice lattice = test::latticeAround(pitch_mm, shape.extent_mm, 0.1);
      const auto surface = test::sampled(shape.distance, lattice, 0.2);
      const FloatTree marked = surfaceVoxelTree(surface->tree(), lattice.layers());
      const auto expected =
          test::surfaceVoxels(test::plainVoxels(test::dense(*surface, lattice.box)));
      int count = 0;
      for (auto v = lattice.box.begin(); v; ++v) {
        ASSERT_EQ(marked.isValueOn(*v), expected[*v] != 0) << shape.name << " " << *v;
        count += expected[*v];
      }
      EXPECT_EQ(static_cast<int>(marked.activeVoxelCount()), count) << shape.name;
    }
  }
}

TEST(SurfaceVoxels, LayersThatAreNotThereAreOutside) {
  const Lattice lattice = test::latticeAround({0.05, 0.05, 0.05}, Vec3d(0.4), 0.1);
  const auto surface = test::sampled(test::sphere(Vec3d(0.0), 0.4), lattice, 0.2);
  const FloatTree marked = surfaceVoxelTree(surface->tree(), {-3, 2});
  EXPECT_TRUE(marked.isValueOn({7, 0, -3}));
  EXPECT_TRUE(marked.isValueOn({6, 0, -3}));
  EXPECT_TRUE(marked.isValueOn({6, 0, 1}));
  EXPECT_FALSE(marked.isValueOn({5, 0, 0}));
  EXPECT_FALSE(marked.isValueOn({7, 0, -4}));
}

TEST(ClosestSurfaceVoxel, EqualsBruteForceOnShapes) {
  for (const Vec3d& pitch_mm : test::testPitches()) {
    for (const test::TestShape& shape : test::testShapes()) {
      SCOPED_TRACE(shape.name);
      const Lattice lattice = test::latticeAround(pitch_mm, shape.extent_mm, 0.1);
      const auto surface = test::sampled(shape.distance, lattice, 0.2);
      const FloatTree marked = surfaceVoxelTree(surface->tree(), lattice.layers());
      const auto listed =
          test::listed(test::surfaceVoxels(test::plainVoxels(test::dense(*surface, lattice.box))));
      // An eighth of the box: the shapes are large enough that every kind of
      // neighbourhood is in it.
      compareWithBruteForce(marked, listed, CoordBBox(lattice.box.min(), Coord(0)), pitch_mm,
                            2 * pitch_mm.length());
    }
  }
}

TEST(ClosestSurfaceVoxel, EqualsBruteForceOnScatteredVoxelsWhateverTheRatioOfPitches) {
  std::mt19937 random(7);
  std::uniform_int_distribution<int> anywhere(-20, 20);
  for (const Vec3d& pitch_mm :
       {Vec3d(1, 1, 1), Vec3d(1, 2, 0.05), Vec3d(0.1, 1, 1), Vec3d(3, 0.3, 1)}) {
    const double radius_mm = pitch_mm.x() < 1 ? 1.5 : 4.1;
    FloatTree marked(0.0F);
    for (int n = 0; n < 200; ++n) {
      marked.setValueOn({anywhere(random), anywhere(random) / 2, anywhere(random) * 3},
                        static_cast<float>(n));
    }
    std::vector<Coord> listed;
    for (auto voxel = marked.cbeginValueOn(); voxel; ++voxel) listed.push_back(voxel.getCoord());
    compareWithBruteForce(marked, listed, CoordBBox({-12, -9, -30}, {7, 10, 20}), pitch_mm,
                          radius_mm);
  }
}

TEST(ClosestSurfaceVoxel, TiesGoToTheSmallestKThenJThenI) {
  const auto closest = [](const std::vector<Coord>& voxels) {
    FloatTree marked(0.0F);
    for (const Coord& voxel : voxels) marked.setValueOn(voxel, 1.0F);
    const SearchDisk disk(Vec3d(1.0), 10);
    ClosestSurfaceVoxel search(marked, disk);
    search.visit(Coord(0));
    return search(0)->ijk;
  };
  EXPECT_EQ(closest({{0, 0, 3}, {0, 0, -3}, {3, 0, 0}, {0, -3, 0}}), Coord(0, 0, -3));
  EXPECT_EQ(closest({{0, 0, 3}, {3, 0, 0}, {-3, 0, 0}, {0, 3, 0}}), Coord(-3, 0, 0));
  EXPECT_EQ(closest({{0, -3, 0}, {-3, 0, 0}, {0, 3, 0}}), Coord(0, -3, 0));
  EXPECT_EQ(closest({{1, 2, 2}, {2, 1, 2}, {2, 2, 1}, {3, 0, 0}}), Coord(3, 0, 0));
}

TEST(ClosestSurfaceVoxel, FindsNothingBeyondTheRadius) {
  FloatTree marked(0.0F);
  marked.setValueOn({0, 3, 4}, 1.0F);
  const auto found = [&](double radius_mm) {
    const SearchDisk disk(Vec3d(1.0), radius_mm);
    ClosestSurfaceVoxel search(marked, disk);
    return search.visit(Coord(0)) && search(0).has_value();
  };
  EXPECT_TRUE(found(5.0));
  EXPECT_FALSE(found(4.999));
}

}  // namespace
}  // namespace vdbdither
