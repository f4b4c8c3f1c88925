#include "ops/kernels/contour/voxel_faces.h"

#include <map>
#include <random>

#include <gtest/gtest.h>

#include "tests/support/mesh_checks.h"

namespace vdbdither {
namespace {

using openvdb::BoolGrid;
using openvdb::Coord;
using openvdb::CoordBBox;
using openvdb::Vec3d;

Mesh facesOf(const BoolGrid& grid, const Lattice& lattice) {
  VoxelFaces faces(lattice);
  Mesh mesh;
  int z = lattice.box.min().z();
  for (BitLayer& layer : bitLayers(grid, faces.layout(), {z, lattice.box.max().z() + 1}))
    append(mesh, faces.add(std::move(layer), z++));
  append(mesh, faces.finish());
  return mesh;
}

TEST(VoxelFaces, OneVoxelIsABlockAroundItsCentre) {
  const Lattice lattice{{0.1, 0.2, 0.4}, {0.01, 0, 0}, CoordBBox(Coord(0), Coord(6))};
  const auto grid = BoolGrid::create(false);
  grid->tree().setValueOn(Coord(2, 3, 4), true);
  const Mesh mesh = facesOf(*grid, lattice);
  EXPECT_EQ(mesh.triangles.size(), 12U);
  EXPECT_NEAR(test::volumeOf(mesh), 0.1 * 0.2 * 0.4, 1e-12);
  Vec3d low = mesh.vertices[0];
  for (const Vec3d& vertex : mesh.vertices) low = openvdb::math::minComponent(low, vertex);
  EXPECT_TRUE(low.eq(Vec3d(0.16, 0.5, 1.4), 1e-12)) << low;
}

/// Against a look at all six neighbours of every voxel; the box crosses words and touches its ends.
TEST(VoxelFaces, ThereIsOneForEveryNeighbourThatIsNotOfTheSet) {
  const CoordBBox box(Coord(-70, -3, -2), Coord(70, 5, 4));
  const Lattice lattice{{1, 1, 1}, {0, 0, 0}, box};
  const auto grid = BoolGrid::create(false);
  std::mt19937 random(7);
  for (auto at = box.begin(); at; ++at) {
    if (random() % 3 != 0) grid->tree().setValueOn(*at, true);
  }
  std::map<std::pair<Coord, Coord>, int> expected;
  std::size_t voxels = 0;
  for (auto at = box.begin(); at; ++at) {
    if (!grid->tree().getValue(*at)) continue;
    ++voxels;
    for (int axis = 0; axis < 3; ++axis) {
      for (const int sign : {-1, 1}) {
        Coord step(0);
        step[axis] = sign;
        if (!grid->tree().getValue(*at + step)) ++expected[{*at + *at + step, step}];
      }
    }
  }
  const Mesh mesh = facesOf(*grid, lattice);
  std::map<std::pair<Coord, Coord>, int> found;
  for (std::size_t face = 0; face < mesh.triangles.size(); face += 2) {
    const Mesh::Triangle& t = mesh.triangles[face];
    const Vec3d normal = (mesh.vertices[t[1]] - mesh.vertices[t[0]])
                             .cross(mesh.vertices[t[2]] - mesh.vertices[t[0]]);
    ++found[{Coord::round(mesh.vertices[t[0]] + mesh.vertices[t[2]]), Coord::round(normal)}];
  }
  EXPECT_TRUE(found == expected);
  EXPECT_NEAR(test::volumeOf(mesh), static_cast<double>(voxels), 1e-6);
}

}  // namespace
}  // namespace vdbdither
