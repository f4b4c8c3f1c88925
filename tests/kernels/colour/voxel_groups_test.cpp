#include "ops/kernels/colour/voxel_groups.h"

#include <algorithm>

#include <gtest/gtest.h>

namespace vdbdither {
namespace {

using openvdb::Coord;
using openvdb::CoordBBox;
using openvdb::Vec3d;

TEST(VoxelGroups, AreTheLargestWithinHalfOfTheLongestEdge) {
  EXPECT_EQ(VoxelGroups(Vec3d(25.4 / 600, 25.4 / 300, 0.014)).size(), Coord(2, 1, 6));
  EXPECT_EQ(VoxelGroups(Vec3d(25.4 / 600, 25.4 / 300, 0.022)).size(), Coord(2, 1, 4));
  EXPECT_EQ(VoxelGroups(Vec3d(0.014, 25.4 / 300, 25.4 / 300)).size(), Coord(4, 1, 1));
  EXPECT_EQ(VoxelGroups(Vec3d(0.1)).size(), Coord(1, 1, 1));
}

TEST(VoxelGroups, EveryVoxelLiesNearTheMiddleOfItsGroup) {
  for (const Vec3d& pitch_mm : {Vec3d(0.042, 0.084, 0.014), Vec3d(0.01, 0.06, 0.02), Vec3d(0.1)}) {
    const VoxelGroups groups(pitch_mm);
    EXPECT_LT(groups.offMm(), 0.5 * std::max({pitch_mm.x(), pitch_mm.y(), pitch_mm.z()}));
    const Lattice voxels{pitch_mm, Vec3d(0.5, -0.25, 3), {Coord(-21, -9, -13), Coord(8, 17, 30)}};
    const Lattice middles = groups.middlesOf(voxels);
    double farthest_mm = 0;
    for (const Coord& ijk : voxels.box) {
      const Coord group(groups.xOf(ijk.x()), groups.yOf(ijk.y()), groups.zOf(ijk.z()));
      ASSERT_TRUE(middles.box.isInside(group)) << ijk;
      ASSERT_TRUE(groups.voxelsOf(CoordBBox(group, group)).isInside(ijk)) << ijk;
      farthest_mm =
          std::max(farthest_mm, (voxels.position(ijk) - middles.position(group)).length());
    }
    EXPECT_NEAR(farthest_mm, groups.offMm(), 1e-12);
  }
}

}  // namespace
}  // namespace vdbdither
