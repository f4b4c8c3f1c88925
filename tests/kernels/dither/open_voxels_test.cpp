#include "ops/kernels/dither/open_voxels.h"

#include <bit>
#include <cstdlib>
#include <map>
#include <mutex>

#include <gtest/gtest.h>

#include "ops/kernels/distance/gradient.h"
#include "ops/kernels/dither/tone_curve.h"
#include "ops/kernels/leaf/voxel_diameter.h"
#include "tests/support/dither_reference.h"
#include "tests/support/shapes.h"

namespace vdbdither {
namespace {

using openvdb::Coord;
using openvdb::Vec3d;

struct Found {
  std::uint32_t depth, tone;
  bool free;
  friend bool operator==(const Found&, const Found&) = default;
};

class OpenVoxels : public testing::Test {
 protected:
  std::map<Coord, Found> found() {
    const ZRange layers = lattice_.layers();
    OpenLeaves leaves(*surface_, nullptr, {pitch_mm_, spread_mm_, true}, BlockOrder(Coord(3, 1, 7)),
                      layers, layers);
    std::map<Coord, Found> voxels;
    std::mutex mutex;
    leaves.visitAtOnce([&](OpenLeaf& leaf) {
      const std::lock_guard lock(mutex);
      for (unsigned x = 0; x < 8; ++x) {
        std::size_t before = 0;
        for (unsigned at = 0; at < x; ++at)
          before += static_cast<std::size_t>(std::popcount(leaf.open[at]));
        EXPECT_EQ(leaf.first[x], before);
      }
      EXPECT_EQ(leaf.voxels.size(), countOf(leaf.open));
      leaf.forEachOpen([&](unsigned offset, const OpenVoxel& voxel) {
        voxels[leaf.leaf->offsetToGlobalCoord(offset)] = {std::bit_cast<std::uint32_t>(voxel.depth),
                                                          std::bit_cast<std::uint32_t>(voxel.tone),
                                                          bitAt(leaf.free, offset)};
      });
    });
    return voxels;
  }

  const Vec3d pitch_mm_{0.042, 0.084, 0.022};
  const Vec3d spread_mm_{0.05, 0.06, 0.04};
  const test::TestShape& shape_ = test::ballShape();
  const Lattice lattice_ = test::latticeAround(pitch_mm_, shape_.extent_mm, 0.15);
  const openvdb::FloatGrid::Ptr surface_ = test::sampled(shape_.distance, lattice_, 0.15);
};

TEST_F(OpenVoxels, AreThoseWithinKDWithTheirDepthsAndTones) {
  const ToneCurve tone;
  std::map<Coord, Found> voxels = found();
  EXPECT_GT(voxels.size(), 1000U);
  const ZRange layers = lattice_.layers();
  LeafNormals normals(surface_->tree(), pitch_mm_, layers);
  for (auto leaf = surface_->tree().cbeginLeaf(); leaf; ++leaf) {
    const LeafBits active = activeBits(*leaf, 0xff);
    normals.visit(*leaf, active);
    forEachBit(active, [&](unsigned offset) {
      const float d = leaf->buffer().data()[offset];
      const openvdb::Vec3s normal = normals.normal(offset);
      const double half_mm = halfVoxelDiameter(normal, pitch_mm_);
      const auto voxel = voxels.find(leaf->offsetToGlobalCoord(offset));
      ASSERT_EQ(voxel != voxels.end(), std::abs(double{d}) < half_mm);
      if (voxel == voxels.end()) return;
      const double spread_mm = (Vec3d(normal) * spread_mm_).length();
      EXPECT_EQ(voxel->second.depth,
                std::bit_cast<std::uint32_t>(static_cast<float>(double{d} / spread_mm)));
      EXPECT_EQ(voxel->second.tone, std::bit_cast<std::uint32_t>(tone(d, half_mm, spread_mm)));
      voxels.erase(voxel);
    });
  }
  EXPECT_TRUE(voxels.empty());
}

TEST_F(OpenVoxels, AreTheSameForEveryInstructionSet) {
  const std::map<Coord, Found> best = found();
  ASSERT_EQ(setenv("VDBDITHER_INSTRUCTIONS", "baseline", 1), 0);
  const std::map<Coord, Found> baseline = found();
  ASSERT_EQ(unsetenv("VDBDITHER_INSTRUCTIONS"), 0);
  EXPECT_TRUE(best == baseline);
}

}  // namespace
}  // namespace vdbdither
