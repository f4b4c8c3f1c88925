#include "ops/kernels/leaf_distances.h"

#include <cstring>
#include <limits>
#include <random>

#include <gtest/gtest.h>

namespace vdbdither {
namespace {

using openvdb::Coord;
using openvdb::CoordBBox;
using openvdb::Vec3d;

TEST(LeafDistances, EveryInstructionSetGivesTheSameBits) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> uniform(-1, 1);
  const Coord origin(-16, 8, 800);
  for (const bool track : {false, true}) {
    LeafDistances fast{};
    std::fill_n(fast.squared, LeafDistances::voxels, std::numeric_limits<double>::infinity());
    LeafDistances portable = fast;
    for (int i = 0; i < 300; ++i) {
      std::array<LinearForm, 9> forms;
      const int rank = 1 + i % 3;
      const int count = rank == 1 ? 4 : rank == 2 ? 4 + i % 4 : 3 + i % 7;
      for (LinearForm& form : forms) {
        form.gradient = Vec3d(uniform(random), uniform(random), uniform(random)) * 0.05;
        if (i % 11 == 0) form.gradient.y() = 0;
        form.constant = 0.2 * uniform(random) - form.gradient.dot(origin.asVec3d());
      }
      const LatticeFeature feature{
          forms.data(), rank, count, 0.25,
          CoordBBox(origin.offsetBy(i % 4, 0, i % 7), origin.offsetBy(9, 5 + i % 4, 8))};
      leafKernels().lower(feature, origin, i, track, fast);
      portableLeafKernels().lower(feature, origin, i, track, portable);
    }
    EXPECT_EQ(std::memcmp(fast.squared, portable.squared, sizeof fast.squared), 0);
    EXPECT_EQ(std::memcmp(fast.nearest, portable.nearest, sizeof fast.nearest), 0);
    EXPECT_LT(*std::min_element(fast.squared, fast.squared + 512), 1e-4);

    LeafBits inside, exists;
    for (std::uint64_t& bits : inside) bits = std::uint64_t{random()} << 32 | random();
    for (std::uint64_t& bits : exists) bits = std::uint64_t{random()} << 32 | random();
    alignas(64) std::array<float, 512> a{}, b{};
    EXPECT_EQ(leafKernels().finish(fast, inside, exists, 0.1, 0.3F, a.data()),
              portableLeafKernels().finish(portable, inside, exists, 0.1, 0.3F, b.data()));
    EXPECT_EQ(std::memcmp(a.data(), b.data(), sizeof a), 0);
  }
}

}  // namespace
}  // namespace vdbdither
