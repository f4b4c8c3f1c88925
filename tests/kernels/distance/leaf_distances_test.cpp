#include "ops/kernels/distance/leaf_distances.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <random>

#include <gtest/gtest.h>

#include "ops/kernels/leaf/tie.h"
#include "ops/kernels/mesh/closest_point.h"
#include "vdbdither/model/instruction_set.h"

namespace vdbdither {
namespace {

using openvdb::Coord;
using openvdb::CoordBBox;

const CoordBBox leaves(Coord(-2, 1, 100), Coord(1, 3, 103));

CoordBBox voxelsOf(const CoordBBox& box) {
  return {box.min() << 3, (box.max() << 3).offsetBy(leaf_layers - 1)};
}

using openvdb::Vec3d;

const Vec3d pitch_mm(0.042, 0.084, 0.022);

/// A triangle about the middle of a region, for a region of rank 1; the corners in mm from its
/// base.
std::array<Vec3d, 3> randomTriangle(std::mt19937& random, LatticeRegion& region,
                                    const Vec3d& middle) {
  std::uniform_real_distribution<double> uniform(-1, 1);
  std::array<Vec3d, 3> corners;
  for (Vec3d& corner : corners) {
    const Vec3d off(uniform(random), uniform(random), random() % 4 == 0 ? 0 : uniform(random));
    corner = (middle + off * 0.5 * region.reach.dim().asVec3d()) * pitch_mm;
  }
  const auto form = [](const Vec3d& gradient, const Vec3d& point) {
    return LatticeForm{gradient.x() * pitch_mm.x(), gradient.y() * pitch_mm.y(),
                       gradient.z() * pitch_mm.z(), -gradient.dot(point)};
  };
  const Vec3d normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]).unit();
  region.distance[0] = form(normal, corners[0]);
  region.spread_mm = random() % 3 == 0 ? 1e-7 : 0.06 * std::abs(uniform(random));
  for (std::size_t s = 0; s < 3; ++s) {
    const Vec3d along = corners[(s + 1) % 3] - corners[s];
    const Vec3d outward = along.unit().cross(normal);
    region.side[s] = {form(outward, corners[s]), form(along.unit(), corners[s]), along.length()};
    const LatticeForm& out = region.side[s].outward;
    region.bound[s] = {-out.x, -out.y, -out.z, region.spread_mm - out.constant};
  }
  return corners;
}

/// A region of `rank` somewhere in the leaves, bounded by up to six planes of any direction.
struct RandomRegion : LatticeRegion {
  std::array<Vec3d, 3> corners;  ///< of rank 1, mm from the base
};
RandomRegion randomRegion(std::mt19937& random, int rank) {
  std::uniform_real_distribution<double> uniform(-1, 1);
  const CoordBBox voxels = voxelsOf(leaves);
  RandomRegion region;
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
  if (rank == 1) {
    region.bounds = std::max(region.bounds, 3);
    region.corners = randomTriangle(random, region, middle);
  }
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
  int beside = 0;
  for (int i = 0; i < 120; ++i) {
    const RandomRegion region = randomRegion(random, 1 + i % 3);
    LeafDistances made;
    made.begin(leaves, false);
    leafKernels().lower(region, 0, false, made);
    for (const Coord& ijk : voxelsOf(leaves)) {
      const Coord offset = ijk - region.base;
      double least = region.reach.isInside(ijk) ? 1 : -1;
      for (int b = 0; b < region.bounds; ++b)
        least = std::min(least, valueAt(region.bound[static_cast<std::size_t>(b)], offset));
      double squared = 0;
      for (int f = 0; f < region.rank; ++f)
        squared += std::pow(valueAt(region.distance[static_cast<std::size_t>(f)], offset), 2);
      bool edge = false;
      if (region.rank == 1) {
        const Vec3d p = offset.asVec3d() * pitch_mm;
        const Vec3d nearest =
            nearestOnTriangle(region.corners[0], region.corners[1], region.corners[2], p).point;
        const double off = std::sqrt(std::max(0.0, (nearest - p).lengthSqr() - squared));
        edge = off > 1e-6;
        least = std::min(least, region.spread_mm - off);
        squared = (nearest - p).lengthSqr();
      }
      const float distance = distanceAt(made, ijk);
      // What a root makes of rounding is more than that of a form.
      const double rounding = region.rank == 1 ? 2e-7 : 1e-12;
      if (least > rounding) {
        ASSERT_NEAR(distance, std::sqrt(squared), 1e-7) << ijk;
        ++lowered;
        beside += edge ? 1 : 0;
      } else if (least < -rounding) {
        ASSERT_TRUE(std::isinf(distance)) << ijk;
      }
    }
  }
  EXPECT_GT(lowered, 10000);
  EXPECT_GT(beside, 1000);
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

TEST(LeafDistances, TheBaselineIsTheCodeForAnyProcessor) {
  ASSERT_EQ(setenv("VDBDITHER_INSTRUCTIONS", "baseline", 1), 0);
  EXPECT_EQ(&leafKernels(), &portableLeafKernels());
  ASSERT_EQ(unsetenv("VDBDITHER_INSTRUCTIONS"), 0);
  EXPECT_EQ(&leafKernels() == &portableLeafKernels(),
            bestInstructionSet() == InstructionSet::baseline);
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
          leafKernels().finish(fast.distances(slot), inside, exists, 0.01F, 0.03F, 0.3F, a.data());
      ASSERT_EQ(active, portableLeafKernels().finish(portable.distances(slot), inside, exists,
                                                     0.01F, 0.03F, 0.3F, b.data()));
      ASSERT_EQ(std::memcmp(a.data(), b.data(), sizeof a), 0);
      for (std::size_t v = 0; v < a.size(); ++v) {
        const auto bit = [&](const LeafBits& bits) { return (bits[v / 64] >> v % 64 & 1) != 0; };
        const float distance = fast.distances(slot)[v];
        ASSERT_EQ(bit(active), distance < 0.03F && bit(exists));
        const float size = !bit(active) ? 0.3F : distance < 0.01F ? tied_mm : distance;
        ASSERT_EQ(a[v], (bit(inside) ? -1.0F : 1.0F) * size);
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
