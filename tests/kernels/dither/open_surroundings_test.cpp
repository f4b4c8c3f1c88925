#include "ops/kernels/dither/open_surroundings.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <map>
#include <mutex>

#include <gtest/gtest.h>

#include "tests/support/dither_reference.h"
#include "tests/support/shapes.h"

namespace vdbdither {
namespace {

using openvdb::Coord;
using openvdb::Vec3d;
using Term = HeightKernel::Term;

struct Setting {
  Vec3d pitch_mm, spread_mm;
  std::vector<Term> terms;
  double reach;
};

std::uint32_t mixed(const Coord& ijk) {
  std::uint32_t bits = 0;
  for (int axis = 0; axis < 3; ++axis)
    bits = (bits ^ static_cast<std::uint32_t>(ijk[axis])) * 2654435761U;
  return bits >> 8U;
}

/// The voxels that a sum may count.
using Voxels = std::map<Coord, OpenVoxel>;

/// The sum by its definition in double precision, over the reach of the kernel.
double referenceSum(const Setting& setting, const Coord& reach, const Voxels& voxels,
                    const Coord& v, float depth) {
  double sum = 0;
  for (int x = -reach.x(); x <= reach.x(); ++x) {
    for (int y = -reach.y(); y <= reach.y(); ++y) {
      for (int z = -reach.z(); z <= reach.z(); ++z) {
        const double apart2 = (Vec3d(x, y, z) * setting.pitch_mm / setting.spread_mm).lengthSqr();
        if (apart2 > setting.reach * setting.reach) continue;
        const auto there = voxels.find(v.offsetBy(x, y, z));
        if (there == voxels.end()) continue;
        const double deeper = double{depth} - double{there->second.depth};
        for (const Term& term : setting.terms) {
          const double slope = 1 / (32 * term.width * term.width);
          const double base = 1 - std::max(apart2 - deeper * deeper, 0.0) * slope;
          sum += double{there->second.error} * term.factor * std::pow(std::max(base, 0.0), 8);
        }
      }
    }
  }
  return sum;
}

/// Compares the sums at some voxels of all blocks of a ball, a third of whose leaves are undecided
/// and set voxel by voxel.
void compareWithReference(const Setting& setting) {
  const test::TestShape& shape = test::ballShape();
  const Lattice lattice = test::latticeAround(setting.pitch_mm, shape.extent_mm, 0.15);
  const auto surface = test::sampled(shape.distance, lattice, 1.5 * setting.pitch_mm.length());
  const HeightKernel kernel(setting.pitch_mm, setting.spread_mm, setting.terms, setting.reach);
  const BlockOrder order(kernel.reach());
  const ZRange layers = lattice.layers();
  OpenLeaves leaves(*surface, nullptr, {setting.pitch_mm, setting.spread_mm, false}, order, layers,
                    layers);
  Voxels decided;
  std::mutex mutex;
  leaves.visitAtOnce([&](OpenLeaf& leaf) {
    const std::lock_guard lock(mutex);
    leaf.decided = mixed(leaf.origin) % 3 != 0;
    leaf.forEachOpen([&](unsigned offset, OpenVoxel& voxel) {
      const Coord ijk = leaf.origin + FloatLeaf::offsetToLocalCoord(offset);
      voxel.error = static_cast<float>(mixed(ijk) % 201) / 100.0F - 1;
      if (leaf.decided) decided[ijk] = voxel;
    });
  });

  int compared = 0;
  OpenLeaves::Finder find(leaves);
  OpenSurroundings best(kernel, order);
  OpenSurroundings baseline(kernel, order, InstructionSet::baseline);
  leaves.visitInOrder(order.needed(layers), [&] {
    return [&](OpenLeaves::Block block) {
      const std::lock_guard lock(mutex);
      Voxels voxels = decided;
      best.visit(block, find);
      baseline.visit(block, find);
      for (OpenLeaf* leaf : block) {
        leaf->forEachOpen([&](unsigned offset, const OpenVoxel& voxel) {
          const Coord ijk = leaf->origin + FloatLeaf::offsetToLocalCoord(offset);
          if (mixed(ijk) % 13 == 0) {
            const float sum = best.sum(ijk, voxel.depth);
            const double reference =
                referenceSum(setting, kernel.reach(), voxels, ijk, voxel.depth);
            ASSERT_NEAR(sum, reference, 2e-5) << ijk;
            ASSERT_EQ(std::bit_cast<std::uint32_t>(sum),
                      std::bit_cast<std::uint32_t>(baseline.sum(ijk, voxel.depth)));
            compared += std::abs(reference) > 0.1;
          }
          if (leaf->decided) return;
          best.set(ijk, voxel.error);
          baseline.set(ijk, voxel.error);
          voxels[ijk] = voxel;
        });
      }
    };
  });
  EXPECT_GT(compared, 100);
}

TEST(OpenSurroundings, SumsOfEveryInstructionSetEqualTheDefinitionInDoublePrecision) {
  compareWithReference({{0.042, 0.084, 0.022}, Vec3d(0.05), {{1.15, 1.15}}, 3.3});
  // Blocks of two leaves in z; and two hills.
  compareWithReference({{0.042, 0.084, 0.014}, {0.06, 0.05, 0.04}, {{1.15, 1.15}}, 3.3});
  compareWithReference({{0.042, 0.084, 0.03}, Vec3d(0.05), {{1, 1}, {2, 0.1}}, 6});
}

}  // namespace
}  // namespace vdbdither
