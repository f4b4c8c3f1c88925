#include "ops/kernels/distance/mesh_distance.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <numbers>
#include <random>

#include <gtest/gtest.h>
#include <openvdb/tools/Prune.h>
#include <tbb/global_control.h>

#include "ops/kernels/distance/mesh_features.h"
#include "ops/kernels/leaf/tie.h"
#include "ops/kernels/mesh/winding_number.h"
#include "tests/support/shapes.h"
#include "tests/support/volumes.h"
#include "vdbdither/model/layers.h"

namespace vdbdither {
namespace {

using openvdb::Coord;
using openvdb::CoordBBox;
using openvdb::Vec3d;
using test::boxMesh;
using test::sphereMesh;
using test::torusMesh;
using test::transformed;

/// Nearest point of a triangle by Ericson's regions ("Real-Time Collision Detection", 5.1.5).
Vec3d nearestPoint(const Vec3d& p, const Vec3d& a, const Vec3d& b, const Vec3d& c) {
  const auto onSegment = [&](const Vec3d& from, const Vec3d& to) {
    const double length = (to - from).lengthSqr();
    return length > 0
               ? from + (to - from) * std::clamp((p - from).dot(to - from) / length, 0.0, 1.0)
               : from;
  };
  Vec3d best = onSegment(a, b);
  for (const Vec3d& other : {onSegment(b, c), onSegment(c, a)})
    if ((other - p).lengthSqr() < (best - p).lengthSqr()) best = other;
  const Vec3d n = (b - a).cross(c - a);
  if (n.dot((b - a).cross(p - a)) >= 0 && n.dot((c - b).cross(p - b)) >= 0 &&
      n.dot((a - c).cross(p - c)) >= 0 && n.lengthSqr() > 1e-20) {
    const Vec3d foot = p - n * (n.dot(p - a) / n.lengthSqr());
    if ((foot - p).lengthSqr() < (best - p).lengthSqr()) best = foot;
  }
  return best;
}

struct Nearest {
  double distance = std::numeric_limits<double>::infinity();
  Vec3d point;
};

Nearest bruteForce(const Mesh& mesh, const Vec3d& p) {
  Nearest best;
  for (const Mesh::Triangle& t : mesh.triangles) {
    const Vec3d point =
        nearestPoint(p, mesh.vertices[t[0]], mesh.vertices[t[1]], mesh.vertices[t[2]]);
    const double distance = (point - p).length();
    if (distance < best.distance) best = {distance, point};
  }
  return best;
}

Lattice latticeAround(const Mesh& mesh, const Vec3d& pitch_mm, const Vec3d& origin_mm, int margin) {
  openvdb::math::BBox<Vec3d> bounds;
  for (const Vec3d& v : mesh.vertices) bounds.expand(v);
  const Vec3d low = (bounds.min() - origin_mm) / pitch_mm;
  const Vec3d high = (bounds.max() - origin_mm) / pitch_mm;
  return {pitch_mm, origin_mm,
          CoordBBox(Coord::floor(low).offsetBy(-margin), Coord::ceil(high).offsetBy(margin))};
}

DistanceGrids distances(const Mesh& mesh, const Lattice& lattice, double band_mm,
                        DistanceExtras extras = {}) {
  return MeshDistance(mesh, lattice, Band{0, band_mm}, extras).run(lattice.layers());
}

const Vec3d mimaki(0.042, 0.084, 0.022);
const Vec3d stratasys(25.4 / 600, 25.4 / 300, 0.027);
const Vec3d cube(0.05, 0.05, 0.05);

/// Checks active states and values of all voxels in the box, and signs where `closed`.
void expectExact(const Mesh& mesh, const Lattice& lattice, double band_mm, bool closed) {
  const DistanceGrids grids = distances(mesh, lattice, band_mm);
  const openvdb::FloatGrid::ConstAccessor surface = grids.surface->getConstAccessor();
  const auto background = static_cast<float>(band_mm);
  const WindingNumber winding(mesh);
  std::mt19937 random(7);
  int active = 0;
  int wrong = 0;
  for (auto it = lattice.box.begin(); it && wrong < 5; ++it) {
    const Coord ijk = *it;
    const bool on = surface.isValueOn(ijk);
    // Far voxels are many and dull: look at some.
    if (!on && random() % 8 != 0) continue;
    const Vec3d p = lattice.position(ijk);
    const double exact = bruteForce(mesh, p).distance;
    const float value = surface.getValue(ijk);
    if (on) {
      ++active;
      if (std::abs(std::abs(value) - exact) > 1e-6)
        ++wrong, ADD_FAILURE() << ijk << " " << value << " exact " << exact;
      if (exact > band_mm + 1e-6)
        ++wrong, ADD_FAILURE() << ijk << " is active beyond the band: " << exact;
    } else {
      if (exact < band_mm - 1e-6)
        ++wrong, ADD_FAILURE() << ijk << " is inactive within the band: " << exact;
      if (std::abs(value) != background)
        ++wrong, ADD_FAILURE() << ijk << " is inactive with " << value;
    }
    if (closed && exact > 1e-6 && (!on || random() % 4 == 0)) {
      const bool inside = std::abs(winding.exactAt(p)) > 0.5;
      if (inside != (value < 0)) ++wrong, ADD_FAILURE() << ijk << " has the wrong sign: " << value;
    }
  }
  EXPECT_GT(active, 0);
}

class OnEveryLattice : public testing::TestWithParam<std::pair<Vec3d, Vec3d>> {
 protected:
  void expectExactOn(const Mesh& mesh, bool closed = true) {
    const auto& [pitch, origin] = GetParam();
    expectExact(mesh, latticeAround(mesh, pitch, origin, 5), pitch.length() * 1.5, closed);
  }
};

INSTANTIATE_TEST_SUITE_P(Lattices, OnEveryLattice,
                         testing::Values(std::pair(mimaki, Vec3d(0, 0, 0)),
                                         std::pair(stratasys, Vec3d(0, 0, 0)),
                                         std::pair(cube, Vec3d(0, 0, 0)),
                                         std::pair(mimaki, Vec3d(0.0, -0.021, 0.0))));

TEST_P(OnEveryLattice, DistanceToASphereIsExact) {
  expectExactOn(sphereMesh({0.3, -0.2, 0.1}, 0.4, 9));
}

TEST_P(OnEveryLattice, DistanceToATiltedBoxIsExact) {
  expectExactOn(
      transformed(boxMesh({-0.5, -0.4, -0.3}, {0.5, 0.4, 0.3}), {2, 31, 12}, {0.1, 0.2, 0.3}));
}

TEST_P(OnEveryLattice, DistanceToABoxOnTheLatticeIsExact) {
  const Vec3d& pitch = GetParam().first;
  expectExactOn(boxMesh(pitch * Vec3d(-4, -3, -8), pitch * Vec3d(5, 4, 11)));
}

TEST_P(OnEveryLattice, DistanceToATorusIsExact) {
  expectExactOn(torusMesh({0, 0, 0.4}, 0.4, 0.15, 16));
}

/// A torus in small triangles whose vertices are a little off, so that it bends every way.
Mesh roughTorus() {
  Mesh mesh = torusMesh({0.1, 0, 0.4}, 0.12, 0.05, 144);
  std::mt19937 random(11);
  std::normal_distribution<double> off(0, 0.00002);
  for (Vec3d& v : mesh.vertices) v += Vec3d(off(random), off(random), off(random));
  return mesh;
}

TEST_P(OnEveryLattice, DistanceToASurfaceThatHardlyBendsIsExact) { expectExactOn(roughTorus()); }

TEST_P(OnEveryLattice, DistanceToASurfaceThatHardlyBendsButHasHolesIsExact) {
  Mesh mesh = roughTorus();
  std::mt19937 random(12);
  std::erase_if(mesh.triangles, [&](const Mesh::Triangle&) { return random() % 50 == 0; });
  expectExactOn(mesh, false);
}

TEST(MeshFeatures, FacesAnswerForWhatHardlyBends) {
  const Mesh mesh = roughTorus();
  const MeshFeatures features(mesh, {}, {0, 0, 0}, 0.1, 0.1, 0.1);
  std::map<MeshFeatures::Kind, std::size_t> count;
  for (std::uint32_t t = 0; t < features.triangles(); ++t)
    features.visit(t, [&](MeshFeatures::Id id) { ++count[id.kind()]; });
  EXPECT_EQ(count[MeshFeatures::Kind::face], mesh.triangles.size());
  EXPECT_LT(count[MeshFeatures::Kind::vertex], mesh.vertices.size() / 2);
  EXPECT_GT(count[MeshFeatures::Kind::vertex], 0);
  EXPECT_LT(count[MeshFeatures::Kind::edge], mesh.triangles.size() / 2);
}

/// A roof of 0.3 mm whose ridge points up and runs along y, with slopes of `degrees`.
Mesh roof(double degrees) {
  const double rise_mm = 0.12 * std::tan(degrees * std::numbers::pi / 180);
  Mesh mesh;
  for (const double y : {-0.15, 0.15})
    for (const Vec3d& corner : {Vec3d(-0.12, y, 0), Vec3d(0.12, y, 0), Vec3d(0, y, rise_mm)})
      mesh.vertices.push_back(corner);
  mesh.triangles = {{0, 1, 2}, {3, 5, 4}, {1, 4, 5}, {1, 5, 2},
                    {0, 2, 5}, {0, 5, 3}, {0, 3, 4}, {0, 4, 1}};
  return mesh;
}

TEST_P(OnEveryLattice, DistanceToABluntRidgeTowardsAnAxisIsExact) {
  for (const double degrees : {20, 38}) {
    for (const Vec3d& turn : {Vec3d(0, 0, 0), Vec3d(180, 0, 0), Vec3d(0, 90, 0), Vec3d(0, -90, 0),
                              Vec3d(90, 0, 90), Vec3d(-90, 0, 90)})
      expectExactOn(transformed(roof(degrees), turn, {0.01, 0.02, 0.005}));
  }
}

TEST_P(OnEveryLattice, DistanceToAThinPlateIsExact) {
  expectExactOn(transformed(boxMesh({-0.7, -0.6, 0}, {0.7, 0.6, 0.004}), {3, 5, 0}, {0, 0, 0}));
}

TEST_P(OnEveryLattice, CavitiesStayHollowInEitherOrientation) {
  Mesh mesh = sphereMesh({0, 0, 0}, 0.4, 6);
  const Mesh cavity = sphereMesh({0.02, 0, 0}, 0.25, 5);
  const auto offset = static_cast<std::uint32_t>(mesh.vertices.size());
  mesh.vertices.insert(mesh.vertices.end(), cavity.vertices.begin(), cavity.vertices.end());
  for (const Mesh::Triangle& t : cavity.triangles)
    mesh.triangles.push_back({t[0] + offset, t[2] + offset, t[1] + offset});
  expectExactOn(mesh);
  for (Mesh::Triangle& t : mesh.triangles) std::swap(t[0], t[1]);
  expectExactOn(mesh);
}

Mesh randomSoup(unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> place(-0.6, 0.6);
  std::normal_distribution<double> normal;
  const auto point = [&] { return Vec3d(place(random), place(random), place(random)); };
  Mesh mesh;
  for (int i = 0; i < 24; ++i) {
    const Vec3d a = point();
    const Vec3d away = Vec3d(normal(random), normal(random), normal(random));
    Vec3d b = point();
    Vec3d c = point();
    switch (i % 6) {
      case 1:  // a sliver
        c = a + (b - a) * 0.4 + away * 1e-6;
        break;
      case 2:  // much smaller than a voxel
        b = a + away * 1e-3;
        c = a + Vec3d(1e-3, 0, 0);
        break;
      case 3:  // no area
        c = a + (b - a) * 0.3;
        break;
      case 4:  // a point
        b = c = a;
        break;
      case 5:  // parallel to x, to z
        b = a + Vec3d(0.3, 0, 0);
        c = a + Vec3d(0, 0, 0.4);
        break;
      default:
        break;
    }
    const auto first = static_cast<std::uint32_t>(mesh.vertices.size());
    mesh.vertices.insert(mesh.vertices.end(), {a, b, c});
    // Some hang on the triangle before, at a vertex or at an edge.
    mesh.triangles.push_back({first, first + 1, i % 4 == 3 ? first - 1 : first + 2});
  }
  return mesh;
}

TEST_P(OnEveryLattice, DistanceToRandomSoupsIsExact) {
  for (unsigned seed = 0; seed < 3; ++seed) expectExactOn(randomSoup(seed), false);
}

TEST(MeshDistance, IsExactAMetreFromTheOrigin) {
  const Mesh mesh =
      transformed(boxMesh({-0.3, -0.2, -0.2}, {0.3, 0.2, 0.2}), {7, 40, 3}, {999, -998, 997});
  expectExact(mesh, latticeAround(mesh, mimaki, {0, 0, 0}, 4), 0.15, true);
}

TEST(MeshDistance, AbruptVerticesOfManyEdgesAreExact) {
  // A needle of 40 sides: its tip has more edges than a vertex keeps bounds.
  Mesh mesh;
  mesh.vertices.emplace_back(0, 0, 0.8);
  mesh.vertices.emplace_back(0, 0, 0);
  for (int i = 0; i < 40; ++i) {
    const double angle = 2 * std::numbers::pi * i / 40;
    mesh.vertices.emplace_back(0.3 * std::cos(angle), 0.3 * std::sin(angle), 0);
  }
  for (std::uint32_t i = 0; i < 40; ++i) {
    mesh.triangles.push_back({0, 2 + i, 2 + (i + 1) % 40});
    mesh.triangles.push_back({1, 2 + (i + 1) % 40, 2 + i});
  }
  expectExact(mesh, latticeAround(mesh, mimaki, {0, 0, 0}, 4), 0.15, true);
}

void expectSame(const openvdb::FloatGrid& a, const openvdb::FloatGrid& b) {
  EXPECT_TRUE(a.tree().hasSameTopology(b.tree()));
  for (auto it = a.tree().cbeginLeaf(); it; ++it) {
    const auto* other = b.tree().probeConstLeaf(it->origin());
    ASSERT_TRUE(other);
    ASSERT_TRUE(std::equal(it->buffer().data(), it->buffer().data() + 512, other->buffer().data()))
        << it->origin();
  }
}

TEST(MeshDistance, SlabsOfAnyHeightGiveTheWhole) {
  const Mesh mesh = transformed(torusMesh({0, 0, 0}, 0.8, 0.3, 30), {20, 30, 0}, {0.3, 0, 0});
  const Lattice lattice = latticeAround(mesh, mimaki, {0, 0, 0}, 5);
  for (const Band band : {Band{}, Band{0, 0.12}}) {
    const MeshDistance field(mesh, lattice, band);
    const DistanceGrids whole = field.run(lattice.layers());
    for (const int height : {8, 16, 40}) {
      std::vector<GridLayers> pieces;
      const ZRange all = alignedToLeaves(lattice.layers());
      for (const ZRange range : test::slabsOf(all, height))
        pieces.push_back({field.run(range).surface, range});
      const auto joined =
          openvdb::gridConstPtrCast<openvdb::FloatGrid>(joinLayers(pieces, all))->deepCopy();
      openvdb::tools::prune(joined->tree());
      expectSame(*whole.surface, *joined);
    }
  }
}

TEST(MeshDistance, ThreadsDoNotChangeABit) {
  const Mesh mesh = sphereMesh({0, 0, 0}, 0.9, 40);
  const Lattice lattice = latticeAround(mesh, mimaki, {0, 0, 0}, 5);
  const DistanceGrids many = distances(mesh, lattice, 0.12, {true, true});
  const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
  const DistanceGrids few = distances(mesh, lattice, 0.12, {true, true});
  expectSame(*many.surface, *few.surface);
  for (auto it = many.normals->cbeginValueOn(); it; ++it)
    ASSERT_EQ(*it, few.normals->tree().getValue(it.getCoord()));
  for (auto it = many.closest->cbeginValueOn(); it; ++it)
    ASSERT_EQ(*it, few.closest->tree().getValue(it.getCoord()));
}

/// Half the voxel's diameter along n, times two: what dithering with the constant 4 moves a surface
/// by at most.
double diameterAlong(const Vec3d& n, const Vec3d& pitch_mm) {
  const Vec3d scaled = n / pitch_mm;
  return 1 / std::max({std::abs(scaled.x()), std::abs(scaled.y()), std::abs(scaled.z())});
}

/// Checks that the default band holds every surface voxel, one neighbour outside for each of its
/// open sides, and every voxel that dithering may decide by what it reads at the closest surface
/// voxel.
void expectBandForDithering(const Mesh& mesh, const Vec3d& pitch_mm) {
  const Lattice lattice = latticeAround(mesh, pitch_mm, {0, 0, 0}, 8);
  const DistanceGrids wide =
      MeshDistance(mesh, lattice, Band{0, 2.5 * pitch_mm.length()}, {true, false})
          .run(lattice.layers());
  const DistanceGrids band = MeshDistance(mesh, lattice, Band{}).run(lattice.layers());
  EXPECT_LT(band.surface->activeVoxelCount(), wide.surface->activeVoxelCount() / 2);
  const openvdb::FloatTree& exact = wide.surface->tree();
  const openvdb::FloatTree& kept = band.surface->tree();
  for (auto it = band.surface->cbeginValueOn(); it; ++it)
    ASSERT_EQ(*it, exact.getValue(it.getCoord()));

  std::vector<Coord> surface_voxels;
  for (auto it = wide.surface->cbeginValueOn(); it; ++it) {
    if (!(*it < 0)) continue;
    bool open = false;
    for (const Coord& step : {Coord(1, 0, 0), Coord(0, 1, 0), Coord(0, 0, 1)}) {
      for (const Coord& neighbour : {it.getCoord() + step, it.getCoord() - step}) {
        if (exact.getValue(neighbour) < 0) continue;
        open = true;
        ASSERT_TRUE(kept.isValueOn(neighbour)) << neighbour;
      }
    }
    if (!open) continue;
    ASSERT_TRUE(kept.isValueOn(it.getCoord())) << it.getCoord();
    surface_voxels.push_back(it.getCoord());
  }
  for (auto it = wide.surface->cbeginValueOn(); it; ++it) {
    const double distance = std::abs(*it);
    if (distance >= pitch_mm.length() || kept.isValueOn(it.getCoord())) continue;
    const Vec3d p = lattice.position(it.getCoord());
    const Coord closest = *std::min_element(
        surface_voxels.begin(), surface_voxels.end(), [&](const Coord& a, const Coord& b) {
          return (lattice.position(a) - p).lengthSqr() < (lattice.position(b) - p).lengthSqr();
        });
    ASSERT_GE(distance,
              diameterAlong(Vec3d(wide.normals->tree().getValue(closest)), pitch_mm) - 1e-6)
        << it.getCoord() << " is decided at " << closest;
  }
}

TEST(MeshDistance, TheDefaultBandHoldsWhatDitheringReads) {
  for (const Vec3d& pitch : {mimaki, stratasys, cube}) {
    expectBandForDithering(sphereMesh({0.1, 0.2, 0.3}, 0.45, 12), pitch);
    expectBandForDithering(boxMesh({-0.31, -0.42, -0.2}, {0.33, 0.4, 0.21}), pitch);
    expectBandForDithering(
        transformed(boxMesh({-0.4, -0.3, -0.2}, {0.4, 0.3, 0.2}), {2, 31, 12}, {0.1, 0.2, 0.3}),
        pitch);
    expectBandForDithering(torusMesh({0, 0, 0.4}, 0.4, 0.2, 18), pitch);
  }
}

/// Checks by brute force that the default band reaches as far as `Band` says, whatever the sign.
void expectDefaultBandReaches(const Mesh& mesh, const Vec3d& pitch_mm) {
  const Lattice lattice = latticeAround(mesh, pitch_mm, {0, 0, 0}, 5);
  const DistanceGrids band = MeshDistance(mesh, lattice, Band{}).run(lattice.layers());
  int reached = 0;
  int wrong = 0;
  for (auto it = lattice.box.begin(); it && wrong < 5; ++it) {
    const Vec3d p = lattice.position(*it);
    const Nearest nearest = bruteForce(mesh, p);
    if (nearest.distance < 1e-6) continue;
    const Vec3d n = (p - nearest.point) / nearest.distance;
    double reach_mm = diameterAlong(n, pitch_mm);
    for (int axis = 0; axis < 3; ++axis)
      reach_mm = std::max(reach_mm, std::abs(n[axis]) * pitch_mm[axis]);
    if (nearest.distance > reach_mm - 1e-6) continue;
    ++reached;
    if (!band.surface->tree().isValueOn(*it))
      ++wrong, ADD_FAILURE() << *it << " at " << nearest.distance << " is inactive";
  }
  EXPECT_GT(reached, 100);
}

TEST(MeshDistance, TheDefaultBandHoldsWhatDitheringReadsOfCoarseSpheres) {
  for (const Vec3d& pitch : {mimaki, cube}) {
    for (const int rings : {2, 3, 4})
      expectBandForDithering(sphereMesh({0.1, 0.2, 0.3}, 0.45, rings), pitch);
  }
}

TEST(MeshDistance, TheDefaultBandReachesAsFarOnCoarseAndOpenMeshes) {
  for (const Vec3d& pitch : {mimaki, cube}) {
    for (const int rings : {2, 3, 4})
      expectDefaultBandReaches(sphereMesh({0.1, 0.2, 0.3}, 0.3, rings), pitch);
    Mesh open = boxMesh({-0.21, -0.22, -0.2}, {0.23, 0.2, 0.21});
    open.triangles.resize(7);
    expectDefaultBandReaches(open, pitch);
    Mesh sheet;
    sheet.vertices = {{-0.31, -0.2, 0.011}, {0.3, -0.22, 0.011}, {0.1, 0.3, 0.011}};
    sheet.triangles = {{0, 1, 2}};
    expectDefaultBandReaches(sheet, pitch);
  }
}

TEST(MeshDistance, NormalsPointFromTheNearestPointOutwards) {
  const Mesh mesh =
      transformed(boxMesh({-0.5, -0.4, -0.3}, {0.5, 0.4, 0.3}), {2, 31, 12}, {0.1, 0.2, 0.3});
  const Lattice lattice = latticeAround(mesh, mimaki, {0, 0, 0}, 5);
  const DistanceGrids grids = distances(mesh, lattice, 0.12, {true, true});
  EXPECT_EQ(grids.normals->activeVoxelCount(), grids.surface->activeVoxelCount());
  EXPECT_EQ(grids.closest->activeVoxelCount(), grids.surface->activeVoxelCount());
  EXPECT_EQ(grids.normals->getVectorType(), openvdb::VEC_COVARIANT_NORMALIZE);
  for (auto it = grids.normals->cbeginValueOn(); it; ++it) {
    const Vec3d p = lattice.position(it.getCoord());
    const double distance = grids.surface->tree().getValue(it.getCoord());
    const Mesh::Triangle& t =
        mesh.triangles[static_cast<std::size_t>(grids.closest->tree().getValue(it.getCoord()))];
    const Vec3d point =
        nearestPoint(p, mesh.vertices[t[0]], mesh.vertices[t[1]], mesh.vertices[t[2]]);
    ASSERT_NEAR((point - p).length(), std::abs(distance), 1e-6);
    ASSERT_NEAR(Vec3d(*it).length(), 1, 1e-6);
    if (std::abs(distance) > 1e-3) {
      // Inside and halfway between two faces either will do.
      const Vec3d expected = (p - point) / distance;
      ASSERT_NEAR((Vec3d(*it) - expected).length(), 0, 1e-4) << it.getCoord();
    }
  }
}

TEST(MeshDistance, NormalsOnTheSurfaceAreThoseOfTheMesh) {
  const Mesh mesh = boxMesh({0, 0, 0}, mimaki * Vec3d(10, 10, 10));
  const Lattice lattice = latticeAround(mesh, mimaki, {0, 0, 0}, 5);
  const DistanceGrids grids = distances(mesh, lattice, 0.12, {true, false});
  const auto normal = [&](int i, int j, int k) {
    return Vec3d(grids.normals->tree().getValue(Coord(i, j, k)));
  };
  EXPECT_NEAR((normal(5, 5, 10) - Vec3d(0, 0, 1)).length(), 0, 1e-6);
  EXPECT_NEAR((normal(5, 0, 5) - Vec3d(0, -1, 0)).length(), 0, 1e-6);
}

TEST(MeshDistance, NormalsAreNotThoseOfTrianglesWithoutArea) {
  // In the way of an edge along x, from its end to its middle and on, and first in the mesh.
  Mesh mesh = boxMesh({0, 0, 0}, mimaki * Vec3d(10, 10, 10));
  const auto at = [&](const Vec3d& p) {
    return static_cast<std::uint32_t>(std::find(mesh.vertices.begin(), mesh.vertices.end(), p) -
                                      mesh.vertices.begin());
  };
  const std::uint32_t from = at({0, 0, 0});
  const std::uint32_t to = at({mimaki.x() * 10, 0, 0});
  const auto middle = static_cast<std::uint32_t>(mesh.vertices.size());
  mesh.vertices.push_back({mimaki.x() * 5, 0, 0});
  // One of the two faces at the edge is cut at the middle; the triangle closes what opens.
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
    Mesh::Triangle& t = mesh.triangles[i];
    const auto start = std::find(t.begin(), t.end(), from) - t.begin();
    if (start == 3 || t[static_cast<std::size_t>(start + 1) % 3] != to) continue;
    const std::uint32_t apex = t[static_cast<std::size_t>(start + 2) % 3];
    t = {from, middle, apex};
    mesh.triangles.push_back({middle, to, apex});
    break;
  }
  mesh.triangles.insert(mesh.triangles.begin(), {from, to, middle});

  const DistanceGrids grids =
      distances(mesh, latticeAround(mesh, mimaki, {0, 0, 0}, 5), 0.12, {true, true});
  for (auto it = grids.normals->cbeginValueOn(); it; ++it)
    ASSERT_NEAR(it->length(), 1, 1e-6) << it.getCoord();
  EXPECT_EQ(std::abs(grids.surface->tree().getValue(Coord(5, 0, 0))), tied_mm);
  EXPECT_NE(grids.closest->tree().getValue(Coord(5, 0, 0)), 0);
}

TEST(MeshDistance, VoxelsOutsideTheBoxAreBackground) {
  const Mesh mesh = sphereMesh({0, 0, 0}, 0.6, 12);
  Lattice lattice = latticeAround(mesh, mimaki, {0, 0, 0}, 5);
  const DistanceGrids whole = distances(mesh, lattice, 0.1);
  lattice.box = CoordBBox(Coord(-3, -5, -11), Coord(9, 6, 13));
  const DistanceGrids part = distances(mesh, lattice, 0.1);
  for (auto it = CoordBBox(Coord(-20, -20, -40), Coord(20, 20, 40)).begin(); it; ++it) {
    const bool inside = lattice.box.isInside(*it);
    ASSERT_EQ(part.surface->tree().getValue(*it),
              inside ? whole.surface->tree().getValue(*it) : 0.1F)
        << *it;
    ASSERT_EQ(part.surface->tree().isValueOn(*it), inside && whole.surface->tree().isValueOn(*it))
        << *it;
  }
}

TEST(MeshDistance, GridsAreNamedAndPlacedForOtherTools) {
  Lattice lattice{mimaki, {0, -0.021, 0}, CoordBBox(Coord(-9), Coord(9))};
  const DistanceGrids grids = distances(sphereMesh({0, 0, 0}, 0.1, 6), lattice, 0.1);
  EXPECT_EQ(grids.surface->getName(), "surface");
  EXPECT_EQ(grids.surface->getGridClass(), openvdb::GRID_LEVEL_SET);
  EXPECT_EQ(grids.surface->background(), 0.1F);
  EXPECT_EQ(grids.surface->indexToWorld(Coord(1, 2, 3)), lattice.position(Coord(1, 2, 3)));
  lattice.origin_mm = {0, 0, 0};
  EXPECT_TRUE(
      distances(sphereMesh({0, 0, 0}, 0.1, 6), lattice, 0.1).surface->transform().isLinear());
}

TEST(MeshDistance, AnEmptyMeshGivesAnEmptyGrid) {
  const DistanceGrids grids =
      distances(Mesh{}, {mimaki, {0, 0, 0}, CoordBBox(Coord(0), Coord(9))}, 0.1);
  EXPECT_TRUE(grids.surface->empty());
}

}  // namespace
}  // namespace vdbdither
