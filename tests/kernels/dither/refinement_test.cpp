#include "ops/kernels/dither/refinement.h"

#include <cmath>
#include <map>

#include <gtest/gtest.h>
#include <tbb/task_arena.h>

#include "ops/kernels/distance/gradient.h"
#include "ops/kernels/dither/tone_curve.h"
#include "tests/support/dither_reference.h"

namespace vdbdither {
namespace {

using openvdb::BoolGrid;
using openvdb::Coord;
using openvdb::FloatGrid;
using openvdb::Vec3d;

const Vec3d spread_mm(0.05);

/// A shape, dithered and ready to refine.
struct Dithered {
  explicit Dithered(const Vec3d& pitch, const test::TestShape& shape)
      : pitch_mm(pitch),
        lattice(test::latticeAround(pitch, shape.extent_mm, 0.3)),
        surface(test::sampled(shape.distance, lattice, 1.5 * pitch.length())),
        solid(ErrorDiffusion(pitch, spread_mm, true)
                  .run(*surface, nullptr, lattice.layers(), lattice.layers())) {}

  [[nodiscard]] BoolGrid::Ptr refined(int sweeps, bool guarded = true) const {
    return Refinement(pitch_mm, spread_mm, guarded, sweeps)
        .run(*surface, nullptr, *solid, lattice.layers(), lattice.layers());
  }

  Vec3d pitch_mm;
  Lattice lattice;
  FloatGrid::Ptr surface;
  BoolGrid::Ptr solid;
};

/// The objective, in double precision over all pairs of voxels.
double energyOf(const Dithered& part, const BoolGrid& solid) {
  struct Voxel {
    Vec3d at;
    double depth, error;
  };
  std::vector<Voxel> voxels;
  const auto normals =
      outwardNormals(*part.surface, part.pitch_mm, part.lattice.layers(), part.lattice.layers());
  const ToneCurve tone;
  for (auto voxel = part.surface->cbeginValueOn(); voxel; ++voxel) {
    const Coord v = voxel.getCoord();
    const Vec3d normal(normals->tree().getValue(v));
    const double k_D = test::halfDiameter(normal, part.pitch_mm);
    if (std::abs(double{*voxel}) >= k_D) continue;
    const double spread = (normal * spread_mm).length();
    const double printed = solid.tree().getValue(v) ? 1 : 0;
    voxels.push_back({v.asVec3d() * part.pitch_mm / spread_mm, *voxel / spread,
                      printed - tone(*voxel, k_D, spread)});
  }
  double energy = 0;
  for (const Voxel& a : voxels) {
    for (const Voxel& b : voxels) {
      const double apart2 = (a.at - b.at).lengthSqr();
      if (apart2 > 36) continue;
      const double x = std::max(0.0, apart2 - (a.depth - b.depth) * (a.depth - b.depth));
      const double narrow = std::pow(std::max(0.0, 1 - x / 32), 8);
      const double wide = std::pow(1 - x / 128, 8);
      energy += a.error * b.error * (narrow + 0.1 * wide);
    }
  }
  return energy;
}

TEST(Refinement, LowersItsObjectiveWithEverySweep) {
  const test::TestShape ball{"ball", test::sphere({0.013, -0.02, 0.007}, 0.7), Vec3d(0.7)};
  for (const Vec3d& pitch_mm : test::testPitches()) {
    const Dithered part(pitch_mm, ball);
    const double before = energyOf(part, *part.solid);
    const double once = energyOf(part, *part.refined(1));
    const double twice = energyOf(part, *part.refined(2));
    EXPECT_LT(once, 0.8 * before) << pitch_mm;
    EXPECT_LT(twice, once) << pitch_mm;
  }
}

TEST(Refinement, ChangesVoxelsOfTheSurfaceAlone) {
  const Dithered part(test::testPitches()[0], test::ballShape());
  const auto refined = part.refined(1);
  int changed = 0;
  for (auto v = part.lattice.box.begin(); v; ++v) {
    const bool differs = refined->tree().getValue(*v) != part.solid->tree().getValue(*v);
    changed += differs;
    if (differs) {
      EXPECT_LT(std::abs(part.surface->tree().getValue(*v)), part.pitch_mm.length() / 2);
    }
  }
  EXPECT_GT(changed, 1000);
}

TEST(Refinement, LeavesThinWallsAsTheyAre) {
  const Vec3d pitch_mm = test::testPitches()[0];
  const test::TestShape wall{"wall", test::box(Vec3d(0.0), {0.6, 0.5, 0.016}, {3, 4, 0}),
                             Vec3d(0.75)};
  const Dithered part(pitch_mm, wall);
  const auto voxels = [&](const BoolGrid& solid) { return test::dense(solid, part.lattice.box); };
  EXPECT_EQ(voxels(*part.refined(2)), voxels(*part.solid));
  EXPECT_GT(test::differences(voxels(*part.refined(2, false)), voxels(*part.solid)), 100);
}

TEST(Refinement, MakesTheSameOfSlabsOfAnyHeightAndOnAnyNumberOfThreads) {
  for (const Vec3d& pitch_mm : {test::testPitches()[0], Vec3d(0.042, 0.084, 0.014)}) {
    const Dithered part(pitch_mm, test::ballShape());
    const Refinement refinement(pitch_mm, spread_mm, true, 2);
    const test::Voxels whole = test::dense(*part.refined(2), part.lattice.box);
    const ZRange all = alignedToLeaves(part.lattice.layers());
    for (const int height : {8, 40}) {
      tbb::task_arena arena(height == 8 ? 1 : 4);
      test::Voxels joined(part.lattice.box, 0);
      for (int begin = all.begin; begin < all.end; begin += height) {
        const ZRange core{begin, std::min(begin + height, all.end)};
        const ZRange valid{begin - refinement.reachLayers(), core.end + refinement.reachLayers()};
        const auto piece = arena.execute(
            [&] { return refinement.run(*part.surface, nullptr, *part.solid, core, valid); });
        for (auto v = part.lattice.box.begin(); v; ++v)
          if (core.contains((*v).z())) joined[*v] = piece->tree().getValue(*v);
      }
      EXPECT_EQ(test::differences(joined, whole), 0) << pitch_mm << " " << height;
    }
  }
}

}  // namespace
}  // namespace vdbdither
