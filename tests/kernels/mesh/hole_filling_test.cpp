#include "ops/kernels/mesh/hole_filling.h"

#include <cmath>
#include <map>
#include <numbers>
#include <random>
#include <set>

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include "ops/kernels/mesh/mesh_placement.h"
#include "ops/kernels/mesh/winding_number.h"
#include "tests/support/mesh_checks.h"
#include "tests/support/shapes.h"

namespace vdbdither {
namespace {

using openvdb::Vec3d;

/// The loops about what a mesh lacks, each simple.
std::vector<HoleLoop> loopsOf(const Mesh& mesh) {
  std::map<std::pair<std::uint32_t, std::uint32_t>, int> sides;
  for (const Mesh::Triangle& t : mesh.triangles)
    for (std::size_t side = 0; side < 3; ++side) ++sides[{t[side], t[(side + 1) % 3]}];
  std::map<std::uint32_t, std::uint32_t> next;
  for (const auto& [side, count] : sides)
    if (!sides.contains({side.second, side.first})) next[side.second] = side.first;
  std::vector<HoleLoop> loops;
  while (!next.empty()) {
    HoleLoop& loop = loops.emplace_back();
    for (auto at = next.begin(); at != next.end(); at = next.find(loop.back())) {
      if (loop.empty()) loop.push_back(at->first);
      loop.push_back(at->second);
      next.erase(at);
    }
    loop.pop_back();
  }
  return loops;
}

/// `mesh` without the triangles about whose middle `lacks` is true.
template <class Lacks>
Mesh without(Mesh mesh, const Lacks& lacks) {
  std::erase_if(mesh.triangles, [&](const Mesh::Triangle& t) {
    return lacks((mesh.vertices[t[0]] + mesh.vertices[t[1]] + mesh.vertices[t[2]]) / 3);
  });
  return mesh;
}

/// A ball of which some of 32 rows of 64 quads are missing.
template <class Lacks>
Mesh ballWithout(const Lacks& lacks) {
  return without(test::sphereMesh({0, 0, 0}, 5, 32), [&](const Vec3d& p) {
    const double step = std::numbers::pi / 32;
    return lacks(static_cast<int>(std::floor(std::asin(p.z() / p.length()) / step)),
                 static_cast<int>(std::floor(std::atan2(p.y(), p.x()) / step)));
  });
}

/// All above a saddle.
Mesh saddleTopped() {
  return ballWithout(
      [](int row, int column) { return row > 6 + 4 * std::cos(column * std::numbers::pi / 16); });
}

/// A stripe that is bent by more than its width.
Mesh withCrescent() {
  return ballWithout([](int row, int column) {
    const int height = row + 3 - column * column / 12;
    return std::abs(column) < 11 && height >= 0 && height < 4;
  });
}

/// A bar of 8 × 8 × 20 mm, cut across and drawn apart by half a millimetre.
Mesh cutBar() {
  const auto lacksTop = [](double z) {
    return [z](const Vec3d& p) { return std::abs(p.z() - z) < 1e-9; };
  };
  return joined({without(test::boxMesh({0, 0, 0}, {8, 8, 10}), lacksTop(10)),
                 without(test::boxMesh({0, 0, 10.5}, {8, 8, 20}), lacksTop(10.5))});
}

Mesh filled(Mesh mesh) {
  const std::vector<HoleLoop> loops = loopsOf(mesh);
  std::set<std::uint32_t> corners;
  for (const HoleLoop& loop : loops)
    for (const std::uint32_t v : loop) EXPECT_TRUE(corners.insert(v).second);
  EXPECT_FALSE(loops.empty());
  fillWhereNumberIsHalf(mesh, loops);
  return mesh;
}
Mesh fanned(Mesh mesh) {
  fillWithFans(mesh, loopsOf(mesh));
  return mesh;
}

/// Of the solid's volume, how much is on another side of `closed` than the number of `open` says.
double share(const Mesh& open, const Mesh& closed) {
  const WindingNumber number(open);
  const WindingNumber made(closed);
  openvdb::math::BBox<Vec3d> box;
  for (const Vec3d& v : open.vertices) box.expand(v);
  std::mt19937 random(5);
  std::uniform_real_distribution<double> uniform(0, 1);
  int wrong = 0;
  int inside = 0;
  for (int i = 0; i < 40'000; ++i) {
    const Vec3d p =
        box.min() + box.extents() * Vec3d(uniform(random), uniform(random), uniform(random));
    const bool expected = number.judgedAt(p) > 0.5;
    inside += expected;
    wrong += expected != (made.judgedAt(p) > 0.5);
  }
  return static_cast<double>(wrong) / inside;
}

TEST(HoleFilling, LiesWhereTheNumberIsAHalf) {
  for (const Mesh& open : {saddleTopped(), withCrescent()}) {
    const Mesh made = filled(open);
    EXPECT_EQ(test::openSides(made), 0U);
    EXPECT_GT(share(open, fanned(open)), 0.005);
    EXPECT_LT(share(open, made), 1e-3);
    EXPECT_LT(made.triangles.size(), open.triangles.size() + 5000);
    const WindingNumber number(open);
    for (std::size_t v = open.vertices.size(); v < made.vertices.size(); ++v)
      EXPECT_NEAR(number.exactAt(made.vertices[v]), 0.5, 0.01) << made.vertices[v];
  }
}

TEST(HoleFilling, JoinsHalvesThatFaceEachOther) {
  const Mesh open = cutBar();
  const Mesh made = filled(open);
  EXPECT_EQ(test::openSides(made), 0U);
  EXPECT_GT(share(open, fanned(open)), 0.02);
  EXPECT_LT(share(open, made), 1e-3);
}

TEST(HoleFilling, LeavesTrianglesAndSidesOfTheMeshAlone) {
  const Mesh open = saddleTopped();
  const Mesh made = filled(open);
  ASSERT_GT(made.triangles.size(), open.triangles.size());
  EXPECT_TRUE(std::equal(open.triangles.begin(), open.triangles.end(), made.triangles.begin()));
  EXPECT_TRUE(std::equal(open.vertices.begin(), open.vertices.end(), made.vertices.begin()));
}

TEST(HoleFilling, AFlatHoleKeepsItsFan) {
  const Mesh open =
      without(test::boxMesh({0, 0, 0}, {4, 5, 6}), [](const Vec3d& p) { return p.z() == 6; });
  EXPECT_EQ(filled(open).triangles, fanned(open).triangles);
  EXPECT_EQ(filled(open).vertices, fanned(open).vertices);
}

TEST(HoleFilling, HolesTooSmallToMatterKeepTheirFans) {
  const Mesh alone = saddleTopped();
  EXPECT_NE(filled(alone).triangles, fanned(alone).triangles);
  const Mesh beside = joined({alone, test::boxMesh({20, 0, 0}, {220, 200, 100})});
  EXPECT_EQ(filled(beside).triangles, fanned(beside).triangles);
}

TEST(HoleFilling, WithinTheSolidKeepsItsFan) {
  // A bar that is open within a ball.
  const Mesh bar =
      without(test::boxMesh({-1, -1, 0}, {1, 1, 12}), [](const Vec3d& p) { return p.z() == 0; });
  const Mesh open = joined({test::sphereMesh({0, 0, 0}, 5, 16), bar});
  EXPECT_EQ(filled(open).triangles, fanned(open).triangles);
}

TEST(HoleFilling, IsTheSameForAnyNumberOfThreads) {
  const Mesh all = filled(withCrescent());
  const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
  const Mesh alone = filled(withCrescent());
  EXPECT_EQ(all.vertices, alone.vertices);
  EXPECT_EQ(all.triangles, alone.triangles);
}

}  // namespace
}  // namespace vdbdither
