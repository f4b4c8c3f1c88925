#include "ops/kernels/contour/zero_set.h"

#include <cmath>
#include <functional>

#include <gtest/gtest.h>

#include "ops/kernels/distance/zero_set_distance.h"
#include "tests/support/mesh_checks.h"
#include "tests/support/volumes.h"

namespace vdbdither {
namespace {

using openvdb::Coord;
using openvdb::CoordBBox;
using openvdb::FloatGrid;
using openvdb::Mat4d;
using openvdb::Vec3d;

/// A turned, anisotropic, mirrored or plain map from indices to mm.
Mat4d mapOf(const Vec3d& cell_mm, double turn, const Vec3d& origin_mm) {
  Mat4d map = Mat4d::identity();
  map.postScale(cell_mm);
  map.postRotate(openvdb::math::X_AXIS, turn);
  map.postRotate(openvdb::math::Z_AXIS, 2 * turn);
  map.postTranslate(origin_mm);
  return map;
}

/// `field` at the nodes of a cube of indices, active where its absolute value is below `band`.
FloatGrid::Ptr sampledField(const std::function<double(const Vec3d&)>& field, const Mat4d& map,
                            int half_edge, double band) {
  auto grid = FloatGrid::create(static_cast<float>(band));
  auto accessor = grid->getAccessor();
  for (const Coord& ijk : CoordBBox(Coord(-half_edge), Coord(half_edge))) {
    const double value = field(map.transform(ijk.asVec3d()));
    if (std::abs(value) < band) {
      accessor.setValueOn(ijk, static_cast<float>(value));
    } else {
      accessor.setValueOff(ijk, static_cast<float>(std::copysign(band, value)));
    }
  }
  grid->pruneGrid();
  return grid;
}

const Vec3d centre(0.13, -0.21, 0.07);
const double ball_mm3 = 4 * M_PI / 3;

TEST(ZeroSet, IsAClosedMeshThatFacesOutwardsUnderAnyMapAndDivision) {
  const auto ball = test::sphere(centre, 1);
  for (const Vec3d& cell_mm : {Vec3d(0.1), Vec3d(0.08, 0.12, 0.1), Vec3d(-0.1, 0.1, 0.1)}) {
    const Mat4d map = mapOf(cell_mm, 0.4, {0.02, 0.01, 0.03});
    const auto grid = sampledField(ball, map, 20, 0.36);
    for (const int divisions : {1, 2, 3}) {
      const ZeroSet surface(grid, map, {}, divisions);
      const Mesh mesh = surface.triangles(-10, 10);
      EXPECT_EQ(test::openSides(mesh), 0U);
      EXPECT_NEAR(test::volumeOf(mesh), ball_mm3, 0.01 * ball_mm3);
      EXPECT_EQ(surface.cells(), static_cast<double>(mesh.vertices.size()));
      for (const Vec3d& vertex : mesh.vertices) ASSERT_LT(std::abs(ball(vertex)), 2e-3) << vertex;
    }
  }
}

TEST(ZeroSet, ReadsValuesOfAnyUnitAndSense) {
  // Fog: half of a smooth step across the surface, in no unit at all.
  const auto fog = [](const Vec3d& p) {
    return 0.5 - 0.5 * std::tanh(4 * ((p - centre).length() - 1));
  };
  const Mat4d map = mapOf(Vec3d(0.1), 0.2, {0, 0, 0});
  auto grid = FloatGrid::create(0);
  for (const Coord& ijk : CoordBBox(Coord(-20), Coord(20)))
    grid->tree().setValueOn(ijk, static_cast<float>(fog(map.transform(ijk.asVec3d()))));
  const ZeroSet surface(grid, map, {0.5F, true}, 2);
  const Mesh mesh = surface.triangles(-10, 10);
  EXPECT_EQ(test::openSides(mesh), 0U);
  EXPECT_NEAR(test::volumeOf(mesh), ball_mm3, 0.01 * ball_mm3);
  ZeroSet::Feet feet(surface);
  for (const double d_mm : {-0.2, -0.01, 0.0, 0.01, 0.2}) {
    // The foot is a little off the surface and beside the right one.
    const Vec3d foot = centre + Vec3d(0.61, 0.02, 0.78);
    EXPECT_NEAR(feet.distanceMm(centre + Vec3d(0.6, 0, 0.8) * (1 + d_mm), foot, d_mm + 0.004), d_mm,
                3e-4);
  }
}

TEST(ZeroSet, SeesTheRimOfTiles) {
  auto grid = FloatGrid::create(0);
  grid->tree().addTile(2, Coord(0), 1.0F, true);
  const Mat4d map = mapOf(Vec3d(0.01), 0, {0, 0, 0});
  const Mesh mesh = ZeroSet(grid, map, {0.5F, true}, 1).triangles(-10, 10);
  EXPECT_EQ(test::openSides(mesh), 0U);
  EXPECT_NEAR(test::volumeOf(mesh), std::pow(1.28, 3), 0.001);
}

TEST(ZeroSet, AStretchOfLayersHasWhatTheWholeHasThere) {
  const auto ball = test::sphere(centre, 1);
  const Mat4d map = mapOf(Vec3d(0.1), 0.4, {0, 0, 0});
  const ZeroSet surface(sampledField(ball, map, 20, 0.36), map, {}, 1);
  const auto within = [](const Mesh& mesh) {
    std::vector<Vec3d> corners;
    for (const Mesh::Triangle& t : mesh.triangles) {
      double low = 10;
      double high = -10;
      for (const std::uint32_t v : t) {
        low = std::min(low, mesh.vertices[v].z());
        high = std::max(high, mesh.vertices[v].z());
      }
      if (high < 0.2 || low > 0.5) continue;
      for (const std::uint32_t v : t) corners.push_back(mesh.vertices[v]);
    }
    return corners;
  };
  const Mesh part = surface.triangles(0.2, 0.5);
  EXPECT_LT(part.triangles.size(), surface.triangles(-10, 10).triangles.size());
  EXPECT_EQ(within(part), within(surface.triangles(-10, 10)));
}

TEST(ZeroSetDistance, IsExactToAHundredthOfAVoxelAndTheSameForAnyCut) {
  const auto ball = test::sphere(centre, 1);
  const Mat4d map = mapOf(Vec3d(0.09), 0.4, {0, 0, 0});
  const auto surface =
      std::make_shared<const ZeroSet>(sampledField(ball, map, 24, 0.3), map, ZeroSet::Reading{}, 1);
  const Vec3d pitch_mm(0.042, 0.084, 0.022);
  const Lattice lattice = test::latticeAround(pitch_mm, Vec3d(1.3), 0.1);
  const ZeroSetDistance field(surface, lattice, {1, 0}, 0.01);
  const auto whole = field.run(lattice.layers());
  int active = 0;
  for (const Coord& ijk : lattice.box) {
    float d = 0;
    const double expected = ball(lattice.position(ijk));
    if (whole->tree().probeValue(ijk, d)) {
      ++active;
      ASSERT_NEAR(d, expected, 0.01 * pitch_mm.z()) << ijk;
    } else {
      ASSERT_GT(std::abs(expected), 0.0219) << ijk;
    }
    if (std::abs(expected) > 0.001) {
      ASSERT_EQ(d < 0, expected < 0) << ijk;
    }
  }
  EXPECT_GT(active, 10000);

  const auto again = ZeroSetDistance(surface, lattice, {1, 0}, 0.01);
  for (const ZRange core : test::slabsOf(lattice.layers())) {
    const auto slab = again.run(core);
    for (auto voxel = slab->cbeginValueOn(); voxel; ++voxel)
      ASSERT_EQ(*voxel, whole->tree().getValue(voxel.getCoord()));
  }
}

}  // namespace
}  // namespace vdbdither
