#include "ops/kernels/mesh/line_winding.h"

#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "ops/kernels/mesh/mesh_placement.h"
#include "ops/kernels/mesh/mesh_repair.h"
#include "ops/kernels/mesh/winding_number.h"
#include "tests/support/shapes.h"

namespace vdbdither {
namespace {

using openvdb::Vec3d;
using test::boxMesh;
using test::sphereMesh;

constexpr double beside_mm = 1e-5;

class Numbers {
 public:
  explicit Numbers(Mesh mesh)
      : mesh_(std::move(mesh)),
        edges_(mesh_),
        boxes_(boxesOf(mesh_)),
        lines_(mesh_, MeshBodies(mesh_, edges_), boxes_) {}

  [[nodiscard]] LineWinding::Sides at(const Vec3d& p, const Vec3d& normal) const {
    return lines_.at(p, normal, beside_mm);
  }
  [[nodiscard]] const Mesh& mesh() const { return mesh_; }

 private:
  static std::vector<BoxTree::Box> boxesOf(const Mesh& mesh) {
    std::vector<BoxTree::Box> boxes(mesh.triangles.size());
    for (std::size_t t = 0; t < boxes.size(); ++t)
      for (const std::uint32_t v : mesh.triangles[t]) boxes[t].expand(mesh.vertices[v]);
    return boxes;
  }

  Mesh mesh_;
  MeshEdges edges_;
  std::vector<BoxTree::Box> boxes_;
  LineWinding lines_;
};

void expectSumsOfSolidAngles(const Mesh& mesh) {
  const Numbers numbers(mesh);
  const WindingNumber exact(mesh);
  std::mt19937 random(3);
  std::uniform_real_distribution<double> share(0, 1);
  for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t) {
    const auto [a, b, c] = cornersOf(mesh, t);
    const double along = share(random);
    const Vec3d p = a + (b - a) * (along * share(random)) + (c - a) * (1 - along);
    const Vec3d normal = (b - a).cross(c - a).unit();
    const LineWinding::Sides sides = numbers.at(p, normal);
    ASSERT_EQ(sides.front, std::lround(exact.exactAt(p + normal * beside_mm))) << t;
    ASSERT_EQ(sides.back, std::lround(exact.exactAt(p - normal * beside_mm))) << t;
  }
}

TEST(LineWinding, NumbersAreThoseOfAllSolidAngles) {
  const Mesh ball = sphereMesh({0.1, 0.2, 0.3}, 1, 10);
  const Mesh other = sphereMesh({0.7, 0.5, 0.4}, 0.9, 9);
  expectSumsOfSolidAngles(ball);
  expectSumsOfSolidAngles(joined({ball, other, sphereMesh({0.1, 0.2, 0.3}, 0.5, 6)}));
  expectSumsOfSolidAngles(
      joined({ball, test::insideOut(sphereMesh({0.1, 0.2, 0.3}, 0.5, 6)), test::insideOut(other)}));
}

TEST(LineWinding, LinesThroughSidesAndCornersAreCountedOnce) {
  // Seen along an axis, places on a grid lie behind the corners and sides of octahedra.
  const Numbers numbers(joined({sphereMesh({0, 0, 0}, 1, 2), sphereMesh({0.5, 0, 0}, 1, 2)}));
  const WindingNumber exact(numbers.mesh());
  int inside = 0;
  for (int i = -6; i <= 8; ++i)
    for (int j = -6; j <= 6; ++j)
      for (int k = -6; k <= 6; ++k) {
        const Vec3d p = 0.25 * Vec3d(i, j, k);
        const auto isOn = [&](double x) {
          return std::abs(std::abs(p.x() - x) + std::abs(p.y()) + std::abs(p.z()) - 1) < 1e-9;
        };
        if (isOn(0) || isOn(0.5)) continue;
        const auto number = std::lround(exact.exactAt(p + Vec3d(1e-7, 2e-7, 3e-7)));
        for (const Vec3d& normal : {Vec3d(1, 0, 0), Vec3d(0, -1, 0), Vec3d(0, 0, 1)}) {
          const LineWinding::Sides sides = numbers.at(p, normal);
          ASSERT_EQ(sides.front, number) << p << normal;
          ASSERT_EQ(sides.back, number) << p << normal;
        }
        inside += number > 0 ? 1 : 0;
      }
  EXPECT_GT(inside, 30);
}

}  // namespace
}  // namespace vdbdither
