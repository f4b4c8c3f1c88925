#include "ops/kernels/leaf_distances.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <random>

#include <gtest/gtest.h>

namespace vdbdither {
namespace {

using openvdb::Coord;
using openvdb::CoordBBox;

const CoordBBox leaves(Coord(-2, 1, 100), Coord(1, 3, 103));

CoordBBox voxelsOf(const CoordBBox& box) {
  return {box.min() << 3, (box.max() << 3).offsetBy(leaf_layers - 1)};
}

/// A region of `rank` somewhere in the leaves, bounded by up to six planes of any direction.
LatticeRegion randomRegion(std::mt19937& random, int rank) {
  std::uniform_real_distribution<double> uniform(-1, 1);
  const CoordBBox voxels = voxelsOf(leaves);
  LatticeRegion region;
  const auto within = [&](int axis) {
    return voxels.min()[axis] +
           static_cast<int>(random() % static_cast<unsigned>(voxels.dim()[axis]));
  };
  for (int axis = 0; axis < 3; ++axis) {
    const auto [low, high] = std::minmax({within(axis), within(axis)});
    region.reach.min()[axis] = low;
    region.reach.max()[axis] = high;
  }
  region.base = region.reach.min().offsetBy(static_cast<int>(random() % 20) - 10) & ~7;
  region.rank = rank;
  const openvdb::Vec3d middle =
      0.5 * (region.reach.min() + region.reach.max()).asVec3d() - region.base.asVec3d();
  const auto form = [&](double away) {
    const LatticeForm made{0.05 * uniform(random), random() % 4 == 0 ? 0 : 0.05 * uniform(random),
                           random() % 4 == 0 ? 0 : 0.05 * uniform(random), 0};
    return LatticeForm{made.x, made.y, made.z,
                       away - made.x * middle.x() - made.y * middle.y() - made.z * middle.z()};
  };
  for (LatticeForm& distance : region.distance) distance = form(0.1 * uniform(random));
  region.bounds = static_cast<int>(random() % 7);
  for (int b = 0; b < region.bounds; ++b)
    region.bound[static_cast<std::size_t>(b)] = form(0.1 + 0.2 * uniform(random));
  return region;
}

double valueAt(const LatticeForm& form, const Coord& offset) {
  return form.x * offset.x() + form.y * offset.y() + form.z * offset.z() + form.constant;
}

float distanceAt(const LeafDistances& all, const Coord& ijk) {
  const float* leaf = all.distances(all.slot(ijk >> 3));
  return leaf ? leaf[openvdb::FloatTree::LeafNodeType::coordToOffset(ijk)]
              : std::numeric_limits<float>::infinity();
}

TEST(LeafDistances, ARegionLowersTheVoxelsWithinItsBoundsAndNoOther) {
  std::mt19937 random(3);
  int lowered = 0;
  for (int i = 0; i < 60; ++i) {
    const LatticeRegion region = randomRegion(random, 1 + i % 3);
    LeafDistances made;
    made.begin(leaves, false);
    leafKernels().lower(region, 0, false, made);
    for (const Coord& ijk : voxelsOf(leaves)) {
      double least = region.reach.isInside(ijk) ? 1 : -1;
      for (int b = 0; b < region.bounds; ++b)
        least =
            std::min(least, valueAt(region.bound[static_cast<std::size_t>(b)], ijk - region.base));
      double squared = 0;
      for (int f = 0; f < region.rank; ++f)
        squared +=
            std::pow(valueAt(region.distance[static_cast<std::size_t>(f)], ijk - region.base), 2);
      const float distance = distanceAt(made, ijk);
      if (least > 1e-12) {
        ASSERT_NEAR(distance, std::sqrt(squared), 1e-7) << ijk;
        ++lowered;
      } else if (least < -1e-12) {
        ASSERT_TRUE(std::isinf(distance)) << ijk;
      }
    }
  }
  EXPECT_GT(lowered, 10000);
}

TEST(LeafDistances, WhatIsLookedAtDoesNotChangeABit) {
  std::mt19937 random(4);
  for (int i = 0; i < 60; ++i) {
    const LatticeRegion region = randomRegion(random, 1 + i % 3);
    LatticeRegion part = region;
    part.reach.max() = (region.reach.min() + region.reach.max()) >> 1;
    LeafDistances whole, less;
    whole.begin(leaves, false);
    less.begin(leaves, false);
    leafKernels().lower(region, 0, false, whole);
    leafKernels().lower(part, 0, false, less);
    for (const Coord& ijk : part.reach) ASSERT_EQ(distanceAt(whole, ijk), distanceAt(less, ijk));
  }
}

TEST(LeafDistances, EveryInstructionSetGivesTheSameBits) {
  std::mt19937 random(5);
  for (const bool track : {false, true}) {
    LeafDistances fast, portable;
    fast.begin(leaves, track);
    portable.begin(leaves, track);
    std::vector<float> fast_bands(fast.slots());
    std::vector<float> portable_bands(fast.slots());
    for (int i = 0; i < 300; ++i) {
      const LatticeRegion region = randomRegion(random, 1 + i % 3);
      const auto name = static_cast<std::uint32_t>(i);
      leafKernels().lower(region, name, track, fast);
      portableLeafKernels().lower(region, name, track, portable);

      const CoordBBox some(region.reach.min() >> 3, region.reach.max() >> 3);
      const LatticeSheet sheet{some.min().offsetBy(-1), some, region.distance[0], 0.05};
      leafKernels().raise(sheet, 0.01F * static_cast<float>(i % 9), fast, fast_bands.data());
      portableLeafKernels().raise(sheet, 0.01F * static_cast<float>(i % 9), portable,
                                  portable_bands.data());
    }
    EXPECT_EQ(fast_bands, portable_bands);
    EXPECT_GT(*std::max_element(fast_bands.begin(), fast_bands.end()), 0.0F);
    for (std::size_t slot = 0; slot < fast.slots(); ++slot) {
      if (fast.distances(slot) == nullptr) {
        ASSERT_EQ(portable.distances(slot), nullptr);
        continue;
      }
      constexpr std::size_t bytes = LeafDistances::voxels * sizeof(float);
      ASSERT_EQ(std::memcmp(fast.distances(slot), portable.distances(slot), bytes), 0);
      if (track) {
        ASSERT_EQ(std::memcmp(fast.names(slot), portable.names(slot), bytes), 0);
      }

      LeafBits inside, exists;
      for (std::uint64_t& bits : inside) bits = std::uint64_t{random()} << 32 | random();
      for (std::uint64_t& bits : exists) bits = std::uint64_t{random()} << 32 | random();
      alignas(64) std::array<float, LeafDistances::voxels> a, b;
      const LeafBits active =
          leafKernels().finish(fast.distances(slot), inside, exists, 0.03F, 0.3F, a.data());
      ASSERT_EQ(active, portableLeafKernels().finish(portable.distances(slot), inside, exists,
                                                     0.03F, 0.3F, b.data()));
      ASSERT_EQ(std::memcmp(a.data(), b.data(), sizeof a), 0);
      for (std::size_t v = 0; v < a.size(); ++v) {
        const auto bit = [&](const LeafBits& bits) { return (bits[v / 64] >> v % 64 & 1) != 0; };
        const float distance = fast.distances(slot)[v];
        ASSERT_EQ(bit(active), distance < 0.03F && bit(exists));
        ASSERT_EQ(a[v], (bit(inside) ? -1.0F : 1.0F) * (bit(active) ? distance : 0.3F));
      }
    }
  }
}

TEST(LeafDistances, ASheetRaisesTheLeavesBetweenItsPlanes) {
  std::mt19937 random(6);
  LeafDistances at;
  at.begin(leaves, false);
  for (int i = 0; i < 30; ++i) {
    const LatticeSheet sheet{leaves.min().offsetBy(-2), leaves, randomRegion(random, 1).distance[0],
                             0.06};
    std::vector<float> raised(at.slots(), 0.1F);
    leafKernels().raise(sheet, 0.2F, at, raised.data());
    for (const Coord& leaf : leaves) {
      const double form = std::abs(valueAt(sheet.form, leaf - sheet.base));
      if (std::abs(form - sheet.limit) > 1e-6) {
        ASSERT_EQ(raised[at.slot(leaf)], form < sheet.limit ? 0.2F : 0.1F) << leaf;
      }
    }
  }
}

}  // namespace
}  // namespace vdbdither
