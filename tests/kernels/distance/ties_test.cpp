#include <algorithm>
#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "ops/kernels/distance/mesh_distance.h"
#include "ops/kernels/leaf/tie.h"
#include "ops/kernels/mesh/mesh_measures.h"
#include "ops/kernels/mesh/winding_number.h"
#include "tests/support/shapes.h"

namespace vdbdither {
namespace {

using openvdb::Coord;
using openvdb::CoordBBox;
using openvdb::Vec3d;

/// What a file in single precision leaves open, as mesh2sdf has it.
double tieOf(const Mesh& mesh) {
  const MeshBounds bounds = boundsOf(mesh);
  double greatest = 0;
  for (int axis = 0; axis < 3; ++axis)
    greatest = std::max({greatest, std::abs(bounds.min[axis]), std::abs(bounds.max[axis])});
  return 0x1p-20 * greatest;
}

Lattice latticeOf(const Mesh& mesh, const Vec3d& pitch_mm) {
  const MeshBounds bounds = boundsOf(mesh);
  return {pitch_mm, Vec3d(0.0),
          CoordBBox(Coord::floor(bounds.min / pitch_mm).offsetBy(-2),
                    Coord::ceil(bounds.max / pitch_mm).offsetBy(2))};
}

openvdb::FloatGrid::Ptr distances(const Mesh& mesh, const Lattice& lattice, double tie_mm) {
  return MeshDistance(mesh, lattice, Band{}, {}, {}, tie_mm).run(lattice.layers()).surface;
}

int voxelsOf(const Mesh& mesh, const Vec3d& pitch_mm) {
  const Lattice lattice = latticeOf(mesh, pitch_mm);
  const auto surface = distances(mesh, lattice, tieOf(mesh));
  int count = 0;
  for (const Coord& ijk : lattice.box) count += surface->tree().getValue(ijk) < 0 ? 1 : 0;
  return count;
}

/// With every quad cut along its other diagonal.
Mesh otherDiagonals(Mesh mesh) {
  for (std::size_t t = 0; t < mesh.triangles.size(); t += 2) {
    const auto [a, b, c] = mesh.triangles[t];
    const std::uint32_t d = mesh.triangles[t + 1][2];
    mesh.triangles[t] = {b, c, d};
    mesh.triangles[t + 1] = {b, d, a};
  }
  return mesh;
}

Mesh inSinglePrecision(Mesh mesh) {
  for (Vec3d& v : mesh.vertices) v = Vec3d(openvdb::Vec3s(v));
  return mesh;
}

TEST(Ties, ACubeHasAsManyVoxelsAsItsVolumeWhereverItLies) {
  for (const Vec3d& corner :
       {Vec3d(0, 0, 0), Vec3d(0.05, 0.05, 0.05), Vec3d(0.0371, -0.02, 0.05), Vec3d(-0.3, 1.2, 0.7),
        Vec3d(12.3, -45.6, 7.8), Vec3d(1000.3, -2000.7, 500.05), Vec3d(9999.9, 0.05, -3333.3)}) {
    const Mesh cube = test::boxMesh(corner, corner + Vec3d(1, 1, 1));
    for (const Mesh& mesh : {cube, otherDiagonals(cube), inSinglePrecision(cube),
                             inSinglePrecision(otherDiagonals(cube))})
      EXPECT_EQ(voxelsOf(mesh, Vec3d(0.1)), 1000) << corner;
  }
}

TEST(Ties, AreNoMoreThanA32ndOfAVoxelApartHoweverFarThePartLies) {
  const double pitch_mm = 0.1;
  // The face at the maximum x lies 3 µm, then 3.3 µm beyond a centre; a 32nd is 3.125 µm.
  for (const double beyond_mm : {0.003, 0.0033}) {
    const Mesh box = test::boxMesh({0, 0, 0}, {1 + beyond_mm, 1, 1});
    const Lattice lattice = latticeOf(box, Vec3d(pitch_mm));
    const auto surface = distances(box, lattice, 1);
    const double d_mm = double{surface->tree().getValue(Coord(10, 5, 5))};
    if (beyond_mm < pitch_mm / 32) {
      EXPECT_EQ(std::abs(d_mm), double{tied_mm});
    } else {
      EXPECT_NEAR(d_mm, -beyond_mm, 1e-6);
    }
  }
}

TEST(Ties, ABoxBeginsWithItsLowerFacesAndEndsBeforeItsUpperOnes) {
  const Vec3d pitch_mm(0.042, 0.084, 0.022);
  const CoordBBox inside(Coord(-2, 5, 9), Coord(7, 9, 20));
  const Mesh mesh = inSinglePrecision(test::boxMesh(inside.min().asVec3d() * pitch_mm,
                                                    inside.max().offsetBy(1).asVec3d() * pitch_mm));
  const Lattice lattice = latticeOf(mesh, pitch_mm);
  for (const Mesh& cut : {mesh, otherDiagonals(mesh)}) {
    const auto surface = distances(cut, lattice, tieOf(cut));
    for (const Coord& ijk : lattice.box)
      ASSERT_EQ(surface->tree().getValue(ijk) < 0, inside.isInside(ijk)) << ijk;
    EXPECT_EQ(surface->tree().getValue(inside.min()), -tied_mm);
    EXPECT_EQ(surface->tree().getValue(inside.max().offsetBy(1)), tied_mm);
  }
}

/// Boxes whose edges are whole steps of the lattice, though none is along an axis.
TEST(Ties, ObliqueFacesThroughCentresAreFlatHoweverTheyAreCut) {
  const Vec3d pitch_mm(0.05);
  const std::vector<std::array<Vec3d, 3>> edges{{Vec3d(4, 2, -4), Vec3d(3, 6, 6), Vec3d(4, -4, 2)},
                                                {Vec3d(3, 4, 0), Vec3d(-8, 6, 0), Vec3d(0, 0, 5)},
                                                {Vec3d(0, 5, 5), Vec3d(0, -4, 4), Vec3d(7, 0, 0)},
                                                {Vec3d(6, 0, 6), Vec3d(0, 5, 0), Vec3d(-3, 0, 3)},
                                                {Vec3d(9, 1, 0), Vec3d(0, 7, 1), Vec3d(-1, 0, 8)}};
  int ties = 0;
  for (const auto& [u, v, w] : edges) {
    for (const Vec3d& corner : {Vec3d(0, 0, 0), Vec3d(211, -98, 77)}) {
      Mesh exact = test::boxMesh({0, 0, 0}, {1, 1, 1});
      for (Vec3d& p : exact.vertices) p = (corner + u * p.x() + v * p.y() + w * p.z()) * pitch_mm;
      const WindingNumber winding(exact);
      const Vec3d shift = pitch_mm * Vec3d(1e-4, 1e-8, 1e-6);
      for (const Mesh& mesh :
           {inSinglePrecision(exact), inSinglePrecision(otherDiagonals(exact))}) {
        const Lattice lattice = latticeOf(mesh, pitch_mm);
        const auto surface = distances(mesh, lattice, tieOf(mesh));
        for (const Coord& ijk : lattice.box) {
          const float d = surface->tree().getValue(ijk);
          const bool inside = std::abs(winding.exactAt(lattice.position(ijk) + shift)) > 0.5;
          ASSERT_EQ(d < 0, inside) << ijk << " of the box at " << corner << " along " << u;
          ties += std::abs(d) == tied_mm ? 1 : 0;
        }
      }
    }
  }
  EXPECT_GT(ties, 1000);
}

TEST(Ties, NothingChangesAwayFromThem) {
  const Mesh mesh =
      test::transformed(test::sphereMesh({0.3, -0.2, 0.1}, 0.4, 9), {2, 31, 12}, {0.1, 0.2, 0.3});
  const Lattice lattice = latticeOf(mesh, {0.042, 0.084, 0.022});
  const double tie_mm = 1e-4;
  const auto plain = distances(mesh, lattice, 0);
  const auto tied = distances(mesh, lattice, tie_mm);
  int near = 0;
  for (const Coord& ijk : lattice.box) {
    const float d = plain->tree().getValue(ijk);
    if (std::abs(d) < tie_mm) {
      ++near;
      ASSERT_EQ(std::abs(tied->tree().getValue(ijk)), tied_mm);
    } else {
      ASSERT_EQ(tied->tree().getValue(ijk), d) << ijk;
    }
  }
  EXPECT_GT(near, 0);
}

TEST(Ties, AreDecidedByTheFirstOfXAndZAndYThatTheNormalHas) {
  EXPECT_TRUE(tieIsInside({-1, 5, 5}));
  EXPECT_FALSE(tieIsInside({1, -5, -5}));
  EXPECT_TRUE(tieIsInside({1e-5, 5, -5}));
  EXPECT_FALSE(tieIsInside({0, -5, 5}));
  EXPECT_TRUE(tieIsInside({0, -1, 0}));
}

}  // namespace
}  // namespace vdbdither
