#include "ops/kernels/mesh/winding_cell.h"

#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "tests/support/shapes.h"

namespace vdbdither {
namespace {

using openvdb::Vec3d;

/// Half a torus, so that its number is a fraction everywhere.
Mesh openMesh() {
  Mesh mesh = test::torusMesh({0, 0, 0}, 0.8, 0.3, 60);
  mesh.triangles.resize(mesh.triangles.size() / 2);
  return mesh;
}

WindingCell cellAt(const Mesh& mesh, const WindingNumber& winding, const Vec3d& low,
                   double edge_mm) {
  std::array<WindingCell::Corner, 8> corners;
  for (unsigned corner = 0; corner < 8; ++corner) {
    const Vec3d p = low + edge_mm * Vec3d(corner & 1, corner >> 1 & 1, corner >> 2 & 1);
    corners[corner] = {winding.exactAt(p), winding.gradientAt(p)};
  }
  return {mesh, winding, low, edge_mm, corners};
}

TEST(WindingCell, SaysWhatTheNumberSays) {
  const Mesh mesh = openMesh();
  const WindingNumber winding(mesh);
  std::mt19937 random(1);
  std::uniform_real_distribution<double> uniform(0, 1);
  const auto somewhere = [&] {
    Vec3d p;
    for (int axis = 0; axis < 3; ++axis) p[axis] = uniform(random);
    return p;
  };
  double missed = 0;
  double gradients_missed = 0;
  for (int i = 0; i < 100; ++i) {
    constexpr double edge_mm = 0.1;
    const Vec3d low = (somewhere() - 0.5) * Vec3d(2.4, 2.4, 0.8);
    const WindingCell cell = cellAt(mesh, winding, low, edge_mm);
    for (int j = 0; j < 20; ++j) {
      const Vec3d p = low + edge_mm * somewhere();
      ASSERT_NEAR(cell.at(mesh, p), winding.exactAt(p), 2e-3) << p;
      missed += std::abs(cell.at(mesh, p) - winding.exactAt(p));
      const Vec3d gradient = winding.gradientAt(p);
      const double gradient_missed = (cell.gradientAt(mesh, p) - gradient).length();
      ASSERT_LT(gradient_missed, 0.3 * gradient.length() + 0.3) << p;
      gradients_missed += gradient_missed;
    }
  }
  EXPECT_LT(missed / 2000, 1e-4);
  EXPECT_LT(gradients_missed / 2000, 0.02);
}

TEST(WindingCell, OfNoTrianglesIsZero) {
  const Mesh mesh;
  EXPECT_EQ(cellAt(mesh, WindingNumber(mesh), {0, 0, 0}, 1).at(mesh, {0.2, 0.3, 0.4}), 0);
}

}  // namespace
}  // namespace vdbdither
