#include "ops/kernels/mesh/solid_volume.h"

#include <numbers>

#include <gtest/gtest.h>

#include "ops/kernels/mesh/mesh_measures.h"
#include "ops/kernels/mesh/mesh_placement.h"
#include "tests/support/shapes.h"

namespace vdbdither {
namespace {

using test::boxMesh;
using test::sphereMesh;

TEST(SolidVolume, OfOneShellIsExact) {
  const Mesh ball = sphereMesh({1000, 2, 3}, 2, 12);
  EXPECT_DOUBLE_EQ(volumeOf(solidMesh(ball)), volumeOf(ball));
  EXPECT_DOUBLE_EQ(volumeOf(solidMesh(test::insideOut(ball))), volumeOf(ball));
}

TEST(SolidVolume, CountsOverlapsOnce) {
  // The tops and bottoms of the first two lie in one plane.
  const double boxes =
      volumeOf(solidMesh(joined({boxMesh({0, 0, 0}, {2, 2, 1}), boxMesh({1, 0.5, 0}, {3, 1.5, 1}),
                                 boxMesh({0.5, 0.5, 0.25}, {1, 1, 0.75})})));
  EXPECT_NEAR(boxes, 5, 5e-5);
  // Two balls of radius 1 whose middles lie 1 apart; the facets miss little.
  const double balls =
      volumeOf(solidMesh(joined({sphereMesh({0, 0, 0}, 1, 90), sphereMesh({1, 0, 0}, 1, 90)})));
  EXPECT_NEAR(balls, std::numbers::pi * (8.0 / 3 - 5.0 / 12), 5e-3);
}

TEST(SolidVolume, LeavesOutCavitiesBesideOverlaps) {
  const double parts = volumeOf(solidMesh(
      joined({boxMesh({0, 0, 0}, {2, 2, 2}), test::insideOut(boxMesh({0.5, 0.5, 0.5}, {1, 1, 1})),
              boxMesh({1.5, 0, 0}, {3, 2, 2})})));
  EXPECT_NEAR(parts, 12 - 0.125, 2e-4);
}

}  // namespace
}  // namespace vdbdither
