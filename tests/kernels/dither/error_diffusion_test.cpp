#include "ops/kernels/dither/error_diffusion.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <map>

#include <gtest/gtest.h>
#include <tbb/task_arena.h>

#include "ops/kernels/distance/gradient.h"
#include "ops/kernels/dither/tone_curve.h"
#include "tests/support/dither_reference.h"

namespace vdbdither {
namespace {

using openvdb::Coord;
using openvdb::FloatGrid;
using openvdb::Vec3d;

int floorOf(int a, int b) { return static_cast<int>(std::floor(static_cast<double>(a) / b)); }

/// When a voxel is decided: the layer's parity, the colour, then leaf by leaf and voxel by voxel.
std::array<int, 9> turnOf(const Coord& v, const Coord& edges) {
  std::array<int, 3> block{};
  std::array<int, 3> leaf{};
  for (int axis = 0; axis < 3; ++axis) {
    const auto n = static_cast<std::size_t>(axis);
    block[n] = floorOf(v[axis], edges[axis]);
    leaf[n] = floorOf(v[axis], 8) * 8;
  }
  const auto odd = [](int n) { return std::abs(n) % 2; };
  return {odd(block[2]), odd(block[1]), odd(block[0]), leaf[0], leaf[1],
          leaf[2],       v.x(),         v.y(),         v.z()};
}

struct Reference {
  double depth, tone;
  bool printed;
  std::array<int, 9> turn;
};

/// Checks every decision against the rule in double precision, given the decisions before it.
void compareWithReference(const Vec3d& pitch_mm, const Vec3d& spread_mm,
                          const test::TestShape& shape, const Coord& edges) {
  const Lattice lattice = test::latticeAround(pitch_mm, shape.extent_mm, 0.15);
  const auto surface = test::sampled(shape.distance, lattice, 1.5 * pitch_mm.length());
  const auto solid = ErrorDiffusion(pitch_mm, spread_mm, false)
                         .run(*surface, nullptr, lattice.layers(), lattice.layers());
  const auto normals = outwardNormals(*surface, pitch_mm, lattice.layers(), lattice.layers());
  const ToneCurve tone;
  std::map<Coord, Reference> open;
  for (auto voxel = surface->cbeginValueOn(); voxel; ++voxel) {
    const Coord v = voxel.getCoord();
    const Vec3d normal(normals->tree().getValue(v));
    const double k_D = test::halfDiameter(normal, pitch_mm);
    const bool printed = solid->tree().getValue(v);
    if (std::abs(std::abs(double{*voxel}) - k_D) < 1e-7) continue;
    if (std::abs(double{*voxel}) > k_D) {
      ASSERT_EQ(printed, *voxel < 0) << v;
      continue;
    }
    const double spread = (normal * spread_mm).length();
    open[v] = {*voxel / spread, tone(*voxel, k_D, spread), printed, turnOf(v, edges)};
  }

  Coord reach;
  for (int axis = 0; axis < 3; ++axis)
    reach[axis] = std::min(16, static_cast<int>(3.3 * spread_mm[axis] / pitch_mm[axis]));
  int overturned = 0;
  for (const auto& [v, voxel] : open) {
    double sum = 0;
    for (int x = -reach.x(); x <= reach.x(); ++x) {
      for (int y = -reach.y(); y <= reach.y(); ++y) {
        for (int z = -reach.z(); z <= reach.z(); ++z) {
          const auto other = open.find(v.offsetBy(x, y, z));
          if (other == open.end() || !(other->second.turn < voxel.turn)) continue;
          const double apart2 = (Vec3d(x, y, z) * pitch_mm / spread_mm).lengthSqr();
          if (apart2 > 3.3 * 3.3) continue;
          const double deeper = voxel.depth - other->second.depth;
          const double w =
              std::pow(1 - std::max(apart2 - deeper * deeper, 0.0) / (32 * 1.15 * 1.15), 8);
          sum += 1.15 * w * ((other->second.printed ? 1 : 0) - other->second.tone);
        }
      }
    }
    if (std::abs(voxel.tone - 0.5 - sum) < 1e-4) continue;
    ASSERT_EQ(voxel.printed, voxel.tone > 0.5 + sum) << v << " " << voxel.tone << " " << sum;
    overturned += voxel.printed != (voxel.depth < 0);
  }
  EXPECT_GT(overturned, 20);
}

TEST(ErrorDiffusion, EqualsItsDefinitionInDoublePrecision) {
  for (const test::TestShape& shape : test::testShapes()) {
    SCOPED_TRACE(shape.name);
    compareWithReference({0.042, 0.084, 0.022}, Vec3d(0.05), shape, {16, 16, 8});
    // Blocks of two leaves in z; and a blur that differs by axis.
    compareWithReference({0.042, 0.084, 0.014}, {0.06, 0.05, 0.04}, shape, {16, 16, 16});
  }
}

TEST(ErrorDiffusion, PrintsTheSameOnAnyNumberOfThreads) {
  const Vec3d pitch_mm = test::testPitches()[0];
  const auto printed = [&](int threads) {
    tbb::task_arena arena(threads);
    return arena.execute([&] { return test::printedByDefault(pitch_mm, test::ballShape()); });
  };
  EXPECT_EQ(printed(1).dithered, printed(4).dithered);
}

TEST(ErrorDiffusion, IsPlainVoxelizationWhereVoxelsAreLargeAgainstTheBlur) {
  const Vec3d pitch_mm = test::testPitches()[0];
  const test::TestShape& shape = test::ballShape();
  const Lattice lattice = test::latticeAround(pitch_mm, shape.extent_mm, 0.3);
  const auto surface = test::sampled(shape.distance, lattice, 1.5 * pitch_mm.length());
  const auto solid = ErrorDiffusion(pitch_mm, Vec3d(0.001), true)
                         .run(*surface, nullptr, lattice.layers(), lattice.layers());
  EXPECT_EQ(test::dense(*solid, lattice.box),
            test::plainVoxels(test::dense(*surface, lattice.box)));
}

TEST(ErrorDiffusion, SphereVolumeIsUnbiased) {
  for (const Vec3d& pitch_mm : test::testPitches()) {
    const double radius = 2.6;
    const test::TestShape sphere{"sphere", test::sphere({0.013, -0.02, 0.007}, radius),
                                 Vec3d(radius)};
    const test::Printed voxels = test::printedByDefault(pitch_mm, sphere);
    double count = 0;
    for (auto v = voxels.dithered.box().begin(); v; ++v) count += voxels.dithered[*v];
    const double truth = 4 * std::acos(-1.0) / 3 * radius * radius * radius;
    EXPECT_NEAR(count * pitch_mm.product() / truth, 1, 2e-4) << pitch_mm;
  }
}

}  // namespace
}  // namespace vdbdither
