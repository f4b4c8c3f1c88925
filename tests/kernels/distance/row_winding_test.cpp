#include "ops/kernels/distance/row_winding.h"

#include <gtest/gtest.h>

namespace vdbdither {
namespace {

using openvdb::Coord;
using openvdb::CoordBBox;

/// Two leaves beside each other along x, with crossings noted.
class RowWindingTest : public testing::Test {
 protected:
  RowWindingTest() { noted_.begin(CoordBBox(Coord(0), Coord(1, 0, 0)), false); }

  void cross(const Coord& ijk, int delta) {
    noted_.note(noted_.slot(ijk >> 3), RowWinding::pack(ijk, delta));
  }
  LeafBits sweep(int leaf) { return winding_.advance(noted_, noted_.slot({leaf, 0, 0})); }
  static bool holds(const LeafBits& bits, const Coord& ijk) {
    return (bits[static_cast<std::size_t>(ijk.x() & 7)] >> (8 * ijk.y() + ijk.z()) & 1) != 0;
  }

  LeafDistances noted_;
  RowWinding winding_;
};

TEST_F(RowWindingTest, VoxelsAreInsideFromTheCrossingInToTheCrossingOut) {
  cross({3, 1, 2}, 1);
  cross({11, 1, 2}, -1);
  const LeafBits first = sweep(0);
  const LeafBits second = sweep(1);
  for (int x = 0; x < 16; ++x)
    EXPECT_EQ(holds(x < 8 ? first : second, {x, 1, 2}), x >= 3 && x < 11) << x;
  EXPECT_FALSE(holds(first, {5, 1, 3}));
  EXPECT_EQ(winding_.bits(), 0U);
}

TEST_F(RowWindingTest, OverlappingShellsStayInsideUntilTheLastOneEnds) {
  cross({1, 0, 0}, 1);
  cross({2, 0, 0}, 1);
  cross({4, 0, 0}, -1);
  cross({6, 0, 0}, -1);
  const LeafBits inside = sweep(0);
  for (int x = 0; x < 8; ++x) EXPECT_EQ(holds(inside, {x, 0, 0}), x >= 1 && x < 6) << x;
}

TEST_F(RowWindingTest, ShellsInsideOutAreInsideToo) {
  cross({2, 7, 7}, -1);
  cross({5, 7, 7}, 1);
  const LeafBits inside = sweep(0);
  for (int x = 0; x < 8; ++x) EXPECT_EQ(holds(inside, {x, 7, 7}), x >= 2 && x < 5) << x;
}

TEST_F(RowWindingTest, CrossingsOfOneVoxelAddUpInAnyOrder) {
  for (const int delta : {1, 1, -1, 1, -1}) cross({4, 3, 3}, delta);
  cross({6, 3, 3}, -1);
  const LeafBits inside = sweep(0);
  for (int x = 0; x < 8; ++x) EXPECT_EQ(holds(inside, {x, 3, 3}), x == 4 || x == 5) << x;
}

}  // namespace
}  // namespace vdbdither
