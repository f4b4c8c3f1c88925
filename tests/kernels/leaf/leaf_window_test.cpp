#include "ops/kernels/leaf/leaf_window.h"

#include <random>

#include <gtest/gtest.h>

namespace vdbdither {
namespace {

using openvdb::Coord;
using openvdb::CoordBBox;

TEST(LeafWindow, HoldsTheValuesOfLeavesTilesAndBackgroundAround) {
  openvdb::FloatTree tree(5.0F);
  tree.sparseFill(CoordBBox(Coord(-16, -8, -40), Coord(-1, 31, 7)), -5.0F, false);
  std::mt19937 random(1);
  std::uniform_int_distribution<int> at(-24, 32);
  for (int n = 0; n < 2000; ++n)
    tree.setValue(Coord(at(random), at(random), at(random)), static_cast<float>(n));
  const ZRange valid{-13, 21};
  const Coord halo(3, 9, 11);
  LeafWindow window(tree, halo, valid);
  for (const Coord& origin : {Coord(0), Coord(-8, 8, -16), Coord(16, -16, 8)}) {
    window.visit(origin);
    for (const Coord& n : CoordBBox(Coord(0) - halo, Coord(7) + halo)) {
      const Coord ijk = origin + n;
      const float expected = valid.contains(ijk.z()) ? tree.getValue(ijk) : 5.0F;
      ASSERT_EQ(*window.at(n.x(), n.y(), n.z()), expected) << ijk;
    }
    EXPECT_EQ(window.at(1, 0, 0) - window.at(0, 0, 0), window.strideX());
    EXPECT_EQ(window.at(0, 1, 0) - window.at(0, 0, 0), window.strideY());
    EXPECT_EQ(window.at(0, 0, 1) - window.at(0, 0, 0), 1);
  }
}

}  // namespace
}  // namespace vdbdither
