#include "ops/kernels/colour/colour_field.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <random>
#include <vector>

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include "ops/kernels/leaf/part_index.h"
#include "ops/kernels/mesh/mesh_measures.h"
#include "tests/support/painted_meshes.h"
#include "tests/support/shapes.h"
#include "vdbdither/model/known_grids.h"
#include "vdbdither/model/layers.h"

namespace vdbdither {
namespace {

using openvdb::Coord;
using openvdb::Vec2d;
using openvdb::Vec2f;
using openvdb::Vec3d;
using openvdb::Vec3s;
using openvdb::Vec4d;
using openvdb::Vec4f;
using test::boxMesh;
using test::checkers;
using test::paintCorners;
using test::sphereMesh;
using test::textureAt;
using test::torusMesh;
using test::transformed;
using test::wrapIn;

const std::vector<Vec3d> pitches{
    {0.042, 0.084, 0.022}, {0.0423, 0.0847, 0.014}, {0.05, 0.05, 0.05}};

Lattice latticeOf(std::span<const Mesh> meshes, const Vec3d& pitch_mm) {
  const MeshBounds bounds = boundsOf(meshes);
  return {pitch_mm,
          Vec3d(0.0),
          {Coord::floor(bounds.min / pitch_mm).offsetBy(-4),
           Coord::ceil(bounds.max / pitch_mm).offsetBy(4)}};
}

/// Some meshes with their colours on a lattice.
struct Part {
  Part(const std::vector<Mesh>& given, const Vec3d& pitch_mm, double depth)
      : meshes(given),
        lattice(latticeOf(meshes, pitch_mm)),
        depth_mm(depth),
        field(std::make_shared<SurfaceColours>(meshes, pitch_mm), lattice, depth, 0) {
    const SolidBodies solids = solidBodies(meshes);
    addSolid(solids.whole);
    for (const SolidMesh& body : solids.bodies) addSolid(body);
  }

  void addSolid(const SolidMesh& solid) {
    field.add(solid);
    distances.emplace_back(solid.mesh, lattice, Band{}, DistanceExtras{.closest = true},
                           solid.walls);
  }

  [[nodiscard]] ColourGrids run(ZRange core, PartOrder order = PartOrder::first) const {
    std::vector<DistanceGrids> bands;
    for (const MeshDistance& distance : distances) bands.push_back(distance.run(core));
    openvdb::Int32Grid::Ptr parts;
    if (bands.size() > 1) {
      std::vector<openvdb::FloatGrid::ConstPtr> surfaces;
      for (std::size_t n = 1; n < bands.size(); ++n) surfaces.push_back(bands[n].surface);
      parts = partIndex(surfaces, order);
    }
    return field.run(bands, parts.get(), core);
  }
  [[nodiscard]] ColourGrids run() const { return run(lattice.layers()); }

  std::vector<Mesh> meshes;
  Lattice lattice;
  double depth_mm;
  ColourField field;
  std::vector<MeshDistance> distances;
};

/// The points of a surface nearest to p, as a list of triangles and shares of their corners.
struct Foot {
  std::size_t triangle = 0;
  std::array<double, 3> shares{};
  double distance_mm = std::numeric_limits<double>::infinity();
};

/// The nearest point of one triangle, among its corners, sides and face.
Foot footOn(const Mesh& mesh, std::size_t triangle, const Vec3d& p) {
  std::array<Vec3d, 3> corner;
  for (std::size_t c = 0; c < 3; ++c) corner[c] = mesh.vertices[mesh.triangles[triangle][c]];
  Foot best;
  const auto consider = [&](const std::array<double, 3>& shares) {
    const Vec3d point = corner[0] * shares[0] + corner[1] * shares[1] + corner[2] * shares[2];
    const double distance = (p - point).length();
    if (distance < best.distance_mm) best = {triangle, shares, distance};
  };
  for (std::size_t a = 0; a < 3; ++a) {
    const std::size_t b = (a + 1) % 3;
    const Vec3d side = corner[b] - corner[a];
    const double along = std::clamp(side.dot(p - corner[a]) / side.lengthSqr(), 0.0, 1.0);
    std::array<double, 3> shares{};
    shares[a] = 1 - along;
    shares[b] = along;
    consider(shares);
  }
  const Vec3d n = (corner[1] - corner[0]).cross(corner[2] - corner[0]);
  std::array<double, 3> shares{};
  for (std::size_t a = 0; a < 3; ++a)
    shares[a] = (corner[(a + 2) % 3] - corner[(a + 1) % 3]).cross(p - corner[(a + 1) % 3]).dot(n) /
                n.lengthSqr();
  if (*std::min_element(shares.begin(), shares.end()) >= 0) consider(shares);
  return best;
}

Foot footOf(const Mesh& mesh, const Vec3d& p) {
  Foot best;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
    if (const Foot foot = footOn(mesh, t, p); foot.distance_mm < best.distance_mm) best = foot;
  return best;
}

/// The mean of a texture over the box of a voxel seen on the triangle of a foot, from many samples.
Vec4d meanOver(const Mesh& mesh, const Foot& foot, const Vec3d& pitch_mm) {
  const Appearance& appearance = *mesh.appearance;
  const Appearance::Coordinates& at = appearance.coordinates[foot.triangle];
  const Mesh::Triangle& t = mesh.triangles[foot.triangle];
  const Vec3d a = mesh.vertices[t[0]];
  const Vec3d first = mesh.vertices[t[1]] - a;
  const Vec3d second = mesh.vertices[t[2]] - a;
  // Coordinates of a point of the plane by least squares.
  const double ff = first.lengthSqr();
  const double fs = first.dot(second);
  const double ss = second.lengthSqr();
  const auto coordinatesAt = [&](const Vec3d& p) {
    const double f = first.dot(p - a);
    const double s = second.dot(p - a);
    const double x = (f * ss - s * fs) / (ff * ss - fs * fs);
    const double y = (s * ff - f * fs) / (ff * ss - fs * fs);
    return Vec2d(at[0]) * (1 - x - y) + Vec2d(at[1]) * x + Vec2d(at[2]) * y;
  };
  const Vec3d middle = a + first * foot.shares[1] + second * foot.shares[2];
  constexpr int count = 9;
  Vec4d sum(0, 0, 0, 0);
  for (int i = 0; i < count; ++i)
    for (int j = 0; j < count; ++j)
      for (int k = 0; k < count; ++k) {
        const Vec3d within((i + 0.5) / count - 0.5, (j + 0.5) / count - 0.5,
                           (k + 0.5) / count - 0.5);
        const Vec2d uv = coordinatesAt(middle + within * pitch_mm);
        sum += textureAt(appearance.textures[0], uv.x(), uv.y(), appearance.materials[0].wrap);
      }
  return sum / (double{count} * count * count);
}

/// Compares the colours of a textured mesh in the band with the reference.
void expectTextured(Mesh mesh, const Vec3d& pitch_mm) {
  const Part part({std::move(mesh)}, pitch_mm, 0.2);
  const Mesh& given = part.meshes.front();
  const ColourGrids grids = part.run();
  const DistanceGrids band = part.distances.front().run(part.lattice.layers());
  std::mt19937 random(11);
  std::vector<double> errors;
  for (auto it = grids.colour->cbeginValueOn(); it; ++it) {
    if (random() % 20 != 0 || !band.surface->tree().isValueOn(it.getCoord())) continue;
    const Vec3d p = part.lattice.position(it.getCoord());
    const Vec4d expected = meanOver(given, footOf(given, p), pitch_mm);
    double most = 0;
    for (int c = 0; c < 3; ++c) most = std::max(most, std::abs((*it)[c] - expected[c]));
    errors.push_back(most);
  }
  ASSERT_GT(errors.size(), 100U);
  std::sort(errors.begin(), errors.end());
  double mean = 0;
  for (const double error : errors) mean += error / static_cast<double>(errors.size());
  EXPECT_LT(mean, 0.01);
  EXPECT_LT(errors[errors.size() * 99 / 100], 0.03);
}

Vec2f aroundTheAxis(const Vec3d& p) {
  return {static_cast<float>(0.5 + 1.3 * p.x() + 0.2 * p.z()),
          static_cast<float>(1.1 * p.y() - p.z())};
}

class ColourFieldOn : public testing::TestWithParam<Vec3d> {};
INSTANTIATE_TEST_SUITE_P(Lattices, ColourFieldOn, testing::ValuesIn(pitches));

TEST_P(ColourFieldOn, TexturesFinerThanVoxelsBecomeTheirMean) {
  Mesh mesh = transformed(boxMesh(Vec3d(-0.7), Vec3d(0.7)), {20, 30, 40}, Vec3d(0.0));
  wrapIn(mesh, checkers(512, 512, 1), aroundTheAxis);
  expectTextured(std::move(mesh), GetParam());
}

TEST_P(ColourFieldOn, TexturesCoarserThanVoxelsAreInterpolated) {
  Mesh mesh = sphereMesh(Vec3d(0.0), 0.8, 12);
  wrapIn(mesh, checkers(8, 8, 1), [](const Vec3d& p) { return 0.3F * aroundTheAxis(p); });
  expectTextured(std::move(mesh), GetParam());
}

/// Colours from which the point of the surface can be read: 0.5 + p / 8 mm.
Vec4f colourOfPlace(const Vec3d& p) {
  const Vec3d colour = Vec3d(0.5) + p / 8;
  return {static_cast<float>(colour.x()), static_cast<float>(colour.y()),
          static_cast<float>(colour.z()), 1};
}
Vec3d placeOfColour(const Vec3s& colour) { return (Vec3d(colour) - Vec3d(0.5)) * 8.0; }

TEST_P(ColourFieldOn, ColoursComeFromTheNearestPointOfTheSurface) {
  const Vec3d pitch_mm = GetParam();
  constexpr double depth_mm = 0.45;
  for (Mesh mesh : {transformed(boxMesh(Vec3d(-0.5), Vec3d(0.7)), {10, 20, 30}, Vec3d(0.1)),
                    torusMesh(Vec3d(0.0), 0.8, 0.4, 16)}) {
    paintCorners(mesh, colourOfPlace);
    const Part part({mesh}, pitch_mm, depth_mm);
    const ColourGrids grids = part.run();
    const DistanceGrids band = part.distances.front().run(part.lattice.layers());
    // How far the middle of the voxels that share a search may lie away.
    const double off_mm = part.field.groups().offMm();
    EXPECT_LT(off_mm, 0.5 * std::max({pitch_mm.x(), pitch_mm.y(), pitch_mm.z()}));
    std::mt19937 random(13);
    int below = 0;
    for (auto it = part.lattice.box.begin(); it; ++it) {
      if (random() % 50 != 0) continue;
      const Vec3d p = part.lattice.position(*it);
      const double nearest_mm = footOf(mesh, p).distance_mm;
      const float distance_mm = band.surface->tree().getValue(*it);
      const bool in_band = band.surface->tree().isValueOn(*it);
      const bool has_colour = grids.colour->tree().isValueOn(*it);
      if (in_band) {
        EXPECT_TRUE(has_colour) << *it;
      } else if (distance_mm > 0 || nearest_mm > depth_mm + off_mm) {
        EXPECT_FALSE(has_colour) << *it << " at " << nearest_mm << " mm";
      } else if (nearest_mm < depth_mm - off_mm) {
        EXPECT_TRUE(has_colour) << *it << " at " << nearest_mm << " mm";
        ++below;
      }
      if (!has_colour) continue;
      const Vec3d found = placeOfColour(grids.colour->tree().getValue(*it));
      EXPECT_LT((found - p).length(), nearest_mm + (in_band ? 0 : 2 * off_mm) + 2e-5) << *it;
      EXPECT_LT(footOf(mesh, found).distance_mm, 2e-5) << *it;
    }
    EXPECT_GT(below, 100);
  }
}

TEST(ColourField, DoesNotDependOnSlabsOrThreads) {
  Mesh mesh = torusMesh(Vec3d(0.0), 0.8, 0.4, 16);
  wrapIn(mesh, checkers(64, 64, 3), aroundTheAxis);
  const Part part({mesh}, pitches[1], 0.3);
  const ColourGrids whole = part.run();
  const tbb::global_control alone(tbb::global_control::max_allowed_parallelism, 1);
  openvdb::Index64 voxels = 0;
  const ZRange layers = part.lattice.layers();
  for (int begin = alignedToLeaves(layers).begin; begin < layers.end; begin += 24) {
    const ColourGrids slab = part.run({begin, begin + 24});
    voxels += slab.colour->activeVoxelCount();
    for (auto it = slab.colour->cbeginValueOn(); it; ++it)
      ASSERT_EQ(*it, whole.colour->tree().getValue(it.getCoord())) << it.getCoord();
  }
  EXPECT_EQ(voxels, whole.colour->activeVoxelCount());
}

TEST(ColourField, OpacityIsAGridWhereSomethingIsLessThanOpaque) {
  Mesh mesh = boxMesh(Vec3d(0.0), Vec3d(1.0));
  paintCorners(mesh, [](const Vec3d&) { return Vec4f(0.2F, 0.4F, 0.6F, 0.25F); });
  const ColourGrids grids = Part({mesh}, pitches[2], 0.2).run();
  ASSERT_TRUE(grids.opacity);
  EXPECT_EQ(grids.opacity->activeVoxelCount(), grids.colour->activeVoxelCount());
  for (auto it = grids.opacity->cbeginValueOn(); it; ++it) ASSERT_EQ(*it, 0.25F);
  for (auto it = grids.colour->cbeginValueOn(); it; ++it) ASSERT_EQ(*it, Vec3s(0.2F, 0.4F, 0.6F));

  paintCorners(mesh, [](const Vec3d&) { return Vec4f(0.2F, 0.4F, 0.6F, 1); });
  EXPECT_FALSE(Part({mesh}, pitches[2], 0.2).run().opacity);
}

TEST(ColourField, OfOverlappingPartsTheFirstOrTheLastWins) {
  Mesh red = boxMesh(Vec3d(0.0), Vec3d(1.0));
  Mesh blue = boxMesh({0.5, 0.2, 0.2}, {1.6, 0.8, 0.8});
  paintCorners(red, [](const Vec3d&) { return Vec4f(1, 0, 0, 1); });
  paintCorners(blue, [](const Vec3d&) { return Vec4f(0, 0, 1, 1); });
  const Part part({red, blue}, pitches[2], 0.4);
  const Coord shared(18, 10, 10);  // 0.1 mm within the first, 0.3 mm within the second
  const Coord second(30, 10, 10);
  const ColourGrids first = part.run(part.lattice.layers(), PartOrder::first);
  EXPECT_EQ(first.colour->tree().getValue(shared), Vec3s(1, 0, 0));
  EXPECT_EQ(first.colour->tree().getValue(second), Vec3s(0, 0, 1));
  const ColourGrids last = part.run(part.lattice.layers(), PartOrder::last);
  EXPECT_EQ(last.colour->tree().getValue(shared), Vec3s(0, 0, 1));
  EXPECT_EQ(last.colour->tree().getValue(second), Vec3s(0, 0, 1));
}

TEST(ColourField, MeshesWithoutColoursAreWhite) {
  Mesh red = boxMesh(Vec3d(0.0), Vec3d(0.5));
  paintCorners(red, [](const Vec3d&) { return Vec4f(1, 0, 0, 1); });
  const Part part({boxMesh({1, 0, 0}, {1.5, 0.5, 0.5}), red}, pitches[2], 0.1);
  const ColourGrids grids = part.run();
  EXPECT_EQ(grids.colour->tree().getValue({21, 5, 5}), Vec3s(1, 1, 1));
  EXPECT_EQ(grids.colour->tree().getValue({1, 5, 5}), Vec3s(1, 0, 0));
}

TEST(ColourField, FilledHolesTakeTheColourOfTheirRim) {
  Mesh mesh = boxMesh(Vec3d(0.0), Vec3d(1.0));
  // Without the triangles of the top.
  std::erase_if(mesh.triangles, [&](const Mesh::Triangle& t) {
    return std::all_of(t.begin(), t.end(),
                       [&](std::uint32_t v) { return mesh.vertices[v].z() == 1; });
  });
  ASSERT_EQ(mesh.triangles.size(), 10U);
  paintCorners(mesh,
               [](const Vec3d& p) { return p.z() == 1 ? Vec4f(0, 1, 0, 1) : Vec4f(1, 0, 0, 1); });
  const ColourGrids grids = Part({mesh}, pitches[2], 0.1).run();
  for (int x = 2; x < 18; ++x) {
    const Vec3s colour = grids.colour->tree().getValue({x, 10, 20});
    EXPECT_NEAR((colour - Vec3s(0, 1, 0)).length(), 0, 1e-6) << x;
  }
}

TEST(ColourField, SeamsKeepTheCoordinatesOfBothSides) {
  // Two sides of a box show opposite ends of a texture at the edge that they share.
  Mesh mesh = boxMesh(Vec3d(0.0), Vec3d(1.0));
  Appearance appearance;
  appearance.textures.push_back(test::makeTexture(2, 1, [](std::uint32_t x, std::uint32_t) {
    return x == 0 ? Vec4d(1, 0, 0, 1) : Vec4d(0, 0, 1, 1);
  }));
  SurfaceMaterial material;
  material.texture = 0;
  appearance.materials.push_back(material);
  for (const Mesh::Triangle& t : mesh.triangles) {
    const bool is_top =
        std::all_of(t.begin(), t.end(), [&](std::uint32_t v) { return mesh.vertices[v].z() == 1; });
    const float u = is_top ? 0.25F : 0.75F;
    appearance.coordinates.push_back({Vec2f(u, 0.5F), Vec2f(u, 0.5F), Vec2f(u, 0.5F)});
    appearance.material.push_back(0);
  }
  mesh.appearance = std::make_shared<Appearance>(appearance);
  const ColourGrids grids = Part({mesh}, pitches[2], 0.1).run();
  EXPECT_EQ(grids.colour->tree().getValue({10, 10, 20}), Vec3s(1, 0, 0));
  EXPECT_EQ(grids.colour->tree().getValue({19, 10, 20}), Vec3s(1, 0, 0));
  EXPECT_EQ(grids.colour->tree().getValue({20, 10, 18}), Vec3s(0, 0, 1));
}

TEST(ColourField, DegenerateCoordinatesGiveTheColourOfAPoint) {
  Mesh mesh = boxMesh(Vec3d(0.0), Vec3d(1.0));
  wrapIn(mesh, checkers(8, 8, 1), [](const Vec3d&) { return Vec2f(0.0625F, 0.0625F); });
  const ColourGrids grids = Part({mesh}, pitches[0], 0.1).run();
  for (auto it = grids.colour->cbeginValueOn(); it; ++it)
    ASSERT_LT((*it - Vec3s(0.9F, 0.2F, 0.1F)).length(), 1e-4);
}

}  // namespace
}  // namespace vdbdither
