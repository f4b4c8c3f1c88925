#include "ops/kernels/mesh/taubin.h"

#include <cmath>
#include <set>

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include "tests/support/mesh_checks.h"
#include "tests/support/shapes.h"

namespace vdbdither {
namespace {

using openvdb::Vec3d;

/// One step of an umbrella operator over sets of neighbours.
std::vector<Vec3d> plainStep(const Mesh& mesh, const std::vector<Vec3d>& from, double share) {
  std::vector<std::set<std::uint32_t>> neighbours(from.size());
  for (const Mesh::Triangle& t : mesh.triangles) {
    for (const std::uint32_t a : t) {
      for (const std::uint32_t b : t) {
        if (a != b) neighbours[a].insert(b);
      }
    }
  }
  std::vector<Vec3d> to = from;
  for (std::size_t v = 0; v < from.size(); ++v) {
    Vec3d mean(0.0);
    for (const std::uint32_t other : neighbours[v]) mean += from[other];
    mean /= static_cast<double>(neighbours[v].size());
    to[v] += share * (mean - from[v]);
  }
  return to;
}

TEST(Taubin, MovesTowardsAndAwayFromTheMeanOfTheNeighbours) {
  Mesh mesh = test::torusMesh({1, 2, 3}, 0.7, 0.3, 20);
  std::vector<Vec3d> expected = mesh.vertices;
  for (int n = 0; n < 7; ++n) {
    expected = plainStep(mesh, expected, 0.5);
    expected = plainStep(mesh, expected, -0.53);
  }
  smooth(mesh, {0.5, -0.53, 7});
  for (std::size_t v = 0; v < expected.size(); ++v)
    EXPECT_TRUE(mesh.vertices[v].eq(expected[v], 1e-12)) << v;
}

TEST(Taubin, SwellsASphereByNoMoreThanItsTransferFunctionAndDoesNotShrinkIt) {
  Mesh mesh = test::sphereMesh({0, 0, 0}, 1, 24);
  const double before = test::volumeOf(mesh);
  smooth(mesh, {});
  // (1 − λk)(1 − μk) is greatest at k = (1/λ + 1/μ) / 2.
  const double k = 0.5 * (1 / 0.5 - 1 / 0.53);
  const double most = std::pow((1 - 0.5 * k) * (1 + 0.53 * k), 160);
  EXPECT_NEAR(most, 1.145, 1e-3);
  EXPECT_GT(test::volumeOf(mesh) / before, 1);
  EXPECT_LT(test::volumeOf(mesh) / before, std::pow(most, 3));
  Mesh shrunk = test::sphereMesh({0, 0, 0}, 1, 24);
  smooth(shrunk, {0.5, 0, 160});
  EXPECT_LT(test::volumeOf(shrunk) / before, 0.5) << "without the steps outwards it shrinks";
}

TEST(Taubin, ThreadsChangeNoBit) {
  Mesh many = test::sphereMesh({0, 0, 0}, 1, 80);
  Mesh one = many;
  smooth(many, {0.5, -0.53, 10});
  {
    const tbb::global_control single(tbb::global_control::max_allowed_parallelism, 1);
    smooth(one, {0.5, -0.53, 10});
  }
  EXPECT_EQ(many.vertices, one.vertices);
}

}  // namespace
}  // namespace vdbdither
