#include "ops/kernels/leaf/simple_point.h"

#include <random>

#include <gtest/gtest.h>

#include "tests/support/volumes.h"

namespace vdbdither {
namespace {

using openvdb::Coord;
using openvdb::CoordBBox;
using test::Touching;
using test::Voxels;

std::uint32_t bitsOf(const Voxels& voxels) {
  std::uint32_t bits = 0;
  for (const Coord& n : CoordBBox(Coord(-1), Coord(1)))
    bits |= std::uint32_t{voxels[n] != 0} << neighbourBit(n.x(), n.y(), n.z());
  return bits;
}

/// By the definition of Bertrand and Malandain (1994): one piece of the inside among the 26
/// neighbours, and one of the outside among the 18 that touches the middle by a face.
bool isSimple(const Voxels& voxels) {
  Voxels inside = voxels;
  inside[Coord(0)] = 0;
  if (test::components(inside, Touching::corners) != 1) return false;
  Voxels outside(voxels.box(), 0);
  for (const Coord& n : voxels.box()) {
    const int away = std::abs(n.x()) + std::abs(n.y()) + std::abs(n.z());
    outside[n] = away != 0 && away != 3 && !voxels[n] ? 1 : 0;
  }
  // Pieces that touch no face of the middle are single voxels.
  for (const Coord& n : voxels.box()) {
    const int away = std::abs(n.x()) + std::abs(n.y()) + std::abs(n.z());
    if (away != 2 || !outside[n]) continue;
    bool touches = false;
    for (int axis = 0; axis < 3; ++axis) {
      Coord face = n;
      face[axis] = 0;
      touches = touches || (n[axis] != 0 && outside[face]);
    }
    if (!touches) outside[n] = 0;
  }
  return test::components(outside, Touching::faces) == 1;
}

TEST(SimplePoint, IsOneWhoseChangeKeepsTheTopology) {
  std::mt19937 random(2);
  int simple = 0;
  for (int n = 0; n < 20000; ++n) {
    Voxels voxels(CoordBBox(Coord(-1), Coord(1)), 0);
    std::bernoulli_distribution inside(0.1 + 0.8 * (n % 100) / 100);
    for (const Coord& at : voxels.box()) voxels[at] = inside(random) ? 1 : 0;
    ASSERT_EQ(isSimplePoint(bitsOf(voxels)), isSimple(voxels)) << bitsOf(voxels);
    simple += isSimple(voxels) ? 1 : 0;
  }
  EXPECT_GT(simple, 1000);
}

TEST(SimplePoint, NeitherLoneVoxelsNorHolesAreSimple) {
  constexpr std::uint32_t all = (1U << 27) - 1;
  EXPECT_FALSE(isSimplePoint(0));
  EXPECT_FALSE(isSimplePoint(all));
  EXPECT_TRUE(isSimplePoint(1U << neighbourBit(0, 0, -1)));
  EXPECT_FALSE(isSimplePoint(1U << neighbourBit(0, 0, -1) | 1U << neighbourBit(0, 0, 1)));
}

}  // namespace
}  // namespace vdbdither
