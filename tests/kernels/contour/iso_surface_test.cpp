#include "ops/kernels/contour/iso_surface.h"

#include <cmath>
#include <numbers>
#include <random>

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include "ops/kernels/contour/marching_cubes.h"
#include "ops/kernels/printing/normal_distribution.h"
#include "tests/support/drawn_grids.h"
#include "tests/support/mesh_checks.h"
#include "tests/support/volumes.h"

namespace vdbdither {
namespace {

using openvdb::BoolGrid;
using openvdb::Coord;
using openvdb::CoordBBox;
using openvdb::FloatGrid;
using openvdb::Vec3d;
using test::eulerCharacteristic;
using test::firstFlaw;
using test::volumeOf;

const Vec3d mimaki_mm(0.042, 0.084, 0.022);

/// The mesh of a grid that comes in pieces of `height` layers. Fails where a piece has triangles at
/// vertices that were to be forgotten.
template <typename GridPtr>
Mesh meshOf(IsoSurface surface, const GridPtr& grid, ZRange layers, int height) {
  Mesh mesh;
  std::uint32_t open_from = 0;
  const auto take = [&](const SurfacePiece& piece) {
    for (const Mesh::Triangle& t : piece.triangles) {
      for (const std::uint32_t vertex : t) EXPECT_GE(vertex, open_from);
    }
    open_from = piece.open_from;
    append(mesh, piece);
  };
  for (int z = layers.begin; z < layers.end; z += height)
    take(surface.add(grid, {z, std::min(z + height, layers.end)}));
  take(surface.finish());
  return mesh;
}

BoolGrid::Ptr randomVoxels(const CoordBBox& box, double share, unsigned seed) {
  const auto grid = BoolGrid::create(false);
  std::mt19937 random(seed);
  for (auto ijk = box.begin(); ijk; ++ijk) {
    if (random() < share * 4294967296.0) grid->tree().setValueOn(*ijk, true);
  }
  return grid;
}

TEST(MarchingCubes, EveryCaseHasPolygonsAndTheComplementCutsTheSameEdges) {
  const auto& cases = cubeCases();
  EXPECT_TRUE(cases[0].triangles.empty());
  EXPECT_TRUE(cases[255].triangles.empty());
  for (std::size_t inside = 1; inside < 255; ++inside) {
    EXPECT_FALSE(cases[inside].triangles.empty());
    EXPECT_EQ(cases[inside].edges, cases[255 - inside].edges);
  }
}

TEST(MarchingCubes, OneCornerFacesAwayFromIt) {
  const auto& triangle = cubeCases()[1].triangles.at(0);
  EXPECT_EQ(triangle, (std::array<std::uint8_t, 3>{0, 4, 8}));
}

TEST(IsoSurface, OneVoxelIsAnOctahedronOfHalfPitches) {
  const auto solid = test::solidOf(*test::drawnMaterial({{"1"}}, 5));
  const Lattice lattice{mimaki_mm, {0, 0, 0}, CoordBBox(Coord(0, 0, 5), Coord(0, 0, 5))};
  const Mesh mesh = meshOf(IsoSurface(lattice), solid, {5, 6}, 8);
  EXPECT_EQ(mesh.vertices.size(), 6U);
  EXPECT_EQ(firstFlaw(mesh), "");
  EXPECT_NEAR(volumeOf(mesh), mimaki_mm.product() / 6, 1e-15);
  EXPECT_EQ(mesh.vertices.front(), Vec3d(0, 0, 4.5 * 0.022)) << "where no voxel is below it";
}

TEST(IsoSurface, VoxelsThatShareAnEdgeAreOnePieceThoseThatShareACornerAreTwo) {
  const Lattice lattice{Vec3d(1), {0, 0, 0}, CoordBBox(Coord(-1), Coord(4))};
  const auto pieces = [&](const std::vector<std::vector<std::string>>& drawn) {
    const Mesh mesh =
        meshOf(IsoSurface(lattice), test::solidOf(*test::drawnMaterial(drawn)), {-1, 5}, 8);
    EXPECT_EQ(firstFlaw(mesh), "");
    return eulerCharacteristic(mesh) / 2;
  };
  EXPECT_EQ(pieces({{"1.", ".1"}}), 1);
  EXPECT_EQ(pieces({{"1."}, {".1"}}), 1);
  EXPECT_EQ(pieces({{"1.", ".."}, {"..", ".1"}}), 2);
}

TEST(IsoSurface, AnyVoxelsHaveAClosedManifoldWhateverTheyTouchAndHoweverTheyAreCut) {
  const CoordBBox box(Coord(-9, 3, -4), Coord(62, 20, 19));  // more than a word, ends at its border
  const Lattice lattice{mimaki_mm, {0, 0, 0}, box};
  for (const double share : {0.1, 0.5, 0.9, 1.0}) {
    const auto solid = randomVoxels(box, share, 7);
    const ZRange layers = lattice.layers();
    const Mesh whole = meshOf(IsoSurface(lattice), solid, layers, 1000);
    EXPECT_EQ(firstFlaw(whole), "") << share;
    EXPECT_GT(volumeOf(whole), 0);
    for (const int height : {1, 8, 11}) {
      const Mesh cut = meshOf(IsoSurface(lattice), solid, layers, height);
      EXPECT_EQ(cut.vertices, whole.vertices);
      EXPECT_EQ(cut.triangles, whole.triangles);
    }
    const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
    EXPECT_EQ(meshOf(IsoSurface(lattice), solid, layers, 8).triangles, whole.triangles);
  }
}

TEST(IsoSurface, OfAFullBoxIsTheBoxWithoutItsEdges) {
  const CoordBBox box(Coord(0), Coord(9, 19, 29));
  const auto solid = BoolGrid::create(false);
  solid->tree().sparseFill(box, true);
  const Mesh mesh = meshOf(IsoSurface({Vec3d(1), {0, 0, 0}, box}), solid, {0, 30}, 8);
  EXPECT_EQ(eulerCharacteristic(mesh), 2);
  // The twelve edges lose a wedge of 1/8 of a voxel, the eight corners what an eighth of an
  // octahedron leaves.
  const double edges = (9 + 19 + 29) * 4 / 8.0;
  const double corners = 8 * (1 / 8.0 - 1 / 48.0);
  EXPECT_NEAR(volumeOf(mesh), 10 * 20 * 30 - edges - corners, 1e-9);
}

TEST(IsoSurface, OfADistanceIsAsFarFromTheSphereAsItsCurvatureBetweenVoxelsMakesIt) {
  const Lattice lattice = test::latticeAround(mimaki_mm, Vec3d(1.0), 0.1);
  const auto distance = test::sphere({0.01, 0.02, -0.1}, 0.83);
  const auto surface = test::sampled(distance, lattice, 0.2);
  const IsoSurface iso(lattice, Inside::below, 0, surface->background());
  const Mesh mesh = meshOf(iso, FloatGrid::ConstPtr(surface), lattice.layers(), 16);
  EXPECT_EQ(firstFlaw(mesh), "");
  EXPECT_EQ(eulerCharacteristic(mesh), 2);
  EXPECT_NEAR(volumeOf(mesh) / (4 * std::numbers::pi / 3 * std::pow(0.83, 3)), 1, 3e-3);
  double furthest = 0;
  for (const Vec3d& p : mesh.vertices) furthest = std::max(furthest, std::abs(distance(p)));
  EXPECT_LT(furthest, 1.01 * 0.084 * 0.084 / (8 * 0.83));
}

TEST(IsoSurface, OfATorusHasItsHole) {
  const Lattice lattice = test::latticeAround(mimaki_mm, Vec3d(1.0, 1.0, 0.3), 0.1);
  const auto surface = test::sampled(test::torus({0, 0, 0}, 0.7, 0.25), lattice, 0.2);
  const IsoSurface iso(lattice, Inside::below, 0, surface->background());
  const Mesh mesh = meshOf(iso, FloatGrid::ConstPtr(surface), lattice.layers(), 8);
  EXPECT_EQ(firstFlaw(mesh), "");
  EXPECT_EQ(eulerCharacteristic(mesh), 0);
}

TEST(IsoSurface, VerticesStayApartWhereTheFieldIsExactlyTheLevelAtVoxels) {
  // A plane through voxel centres, and a point that the surface only touches.
  const CoordBBox box(Coord(-4), Coord(4));
  const auto field = FloatGrid::create(1.0F);
  for (auto ijk = box.begin(); ijk; ++ijk)
    field->tree().setValueOn(*ijk, static_cast<float>((*ijk).z()) / 8);
  field->tree().setValueOn(Coord(0, 0, -2), 0.0F);
  const Mesh mesh = meshOf(IsoSurface({mimaki_mm, {0, 0, 0}, box}, Inside::below, 0, 1.0F),
                           FloatGrid::ConstPtr(field), {-4, 5}, 8);
  EXPECT_EQ(firstFlaw(mesh), "");
  for (const Mesh::Triangle& t : mesh.triangles) {
    for (std::size_t side = 0; side < 3; ++side) {
      const Vec3d apart = mesh.vertices[t[side]] - mesh.vertices[t[(side + 1) % 3]];
      EXPECT_GT(apart.length(), 0.022 / 300);
    }
  }
}

TEST(IsoSurface, IsClosedAtTheBoxAndAtTheFirstAndLastLayer) {
  const CoordBBox box(Coord(0), Coord(10, 10, 40));
  const Lattice lattice{mimaki_mm, {0, 0, 0}, box};
  const auto field = FloatGrid::create(0.2F);
  for (auto ijk = CoordBBox(Coord(-20), Coord(60)).begin(); ijk; ++ijk)
    field->tree().setValueOff(*ijk, -0.2F);
  const Mesh mesh =
      meshOf(IsoSurface(lattice, Inside::below, 0, 0.2F), FloatGrid::ConstPtr(field), {8, 24}, 8);
  EXPECT_EQ(firstFlaw(mesh), "");
  EXPECT_EQ(eulerCharacteristic(mesh), 2);
  Vec3d low = mesh.vertices.front();
  Vec3d high = low;
  for (const Vec3d& p : mesh.vertices) {
    low = openvdb::math::minComponent(low, p);
    high = openvdb::math::maxComponent(high, p);
  }
  EXPECT_TRUE(low.eq(Vec3d(-0.5, -0.5, 7.5) * mimaki_mm, 1e-12)) << low;
  EXPECT_TRUE(high.eq(Vec3d(10.5, 10.5, 23.5) * mimaki_mm, 1e-12)) << high;
}

TEST(IsoSurface, BetweenOccupanciesThePlaneOfABlurredHalfSpaceIsExact) {
  const CoordBBox box(Coord(-12), Coord(12));
  const Vec3d normal = Vec3d(0.3, 0.9, 0.2).unit();
  const double sigma_mm = 0.05;
  const auto field = FloatGrid::create(0.0F);
  for (auto ijk = box.begin(); ijk; ++ijk) {
    const double d = normal.dot((*ijk).asVec3d() * mimaki_mm) - 0.013;
    field->tree().setValueOn(*ijk, static_cast<float>(normalShare(-d / sigma_mm)));
  }
  const auto furthest = [&](IsoSurface::Between between) {
    const Mesh mesh =
        meshOf(IsoSurface({mimaki_mm, {0, 0, 0}, box}, Inside::above, 0.5F, 0, between),
               FloatGrid::ConstPtr(field), {-12, 13}, 8);
    double most = 0;
    for (const Vec3d& p : mesh.vertices) {
      const Vec3d index = p / mimaki_mm;
      if (std::max({std::abs(index.x()), std::abs(index.y()), std::abs(index.z())}) < 12)
        most = std::max(most, std::abs(normal.dot(p) - 0.013));
    }
    return most;
  };
  EXPECT_LT(furthest(IsoSurface::Between::probit), 0.084 / 256 + 1e-6);
  EXPECT_GT(furthest(IsoSurface::Between::linear), 0.002);
}

TEST(IsoSurface, OfNothingIsNothing) {
  const Lattice lattice{mimaki_mm, {0, 0, 0}, CoordBBox(Coord(0), Coord(9))};
  EXPECT_TRUE(meshOf(IsoSurface(lattice), BoolGrid::create(false), {0, 10}, 8).vertices.empty());
  EXPECT_TRUE(IsoSurface(lattice).finish().triangles.empty());
}

TEST(Probit, UndoesTheNormalDistribution) {
  for (double x = -6; x <= 6; x += 0.37) EXPECT_NEAR(probit(normalShare(x)), x, 1e-7) << x;
  EXPECT_NEAR(probit(0.5), 0, 1e-15);
  EXPECT_EQ(probit(0), probit(-1));
  EXPECT_EQ(probit(1), -probit(0));
}

}  // namespace
}  // namespace vdbdither
