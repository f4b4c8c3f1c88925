#include "ops/kernels/mesh/solid_mesh.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <random>
#include <utility>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "ops/kernels/mesh/closest_point.h"
#include "ops/kernels/mesh/mesh_placement.h"
#include "tests/support/mesh_checks.h"
#include "tests/support/shapes.h"
#include "vdbdither/model/errors.h"

namespace vdbdither {
namespace {

using openvdb::Vec3d;
using test::boxMesh;
using test::insideOut;
using test::sphereMesh;
using testing::Each;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::ThrowsMessage;

std::vector<std::uint32_t> countedFrom(std::uint32_t first, std::size_t count) {
  std::vector<std::uint32_t> indices(count);
  std::iota(indices.begin(), indices.end(), first);
  return indices;
}

/// How far the farthest corner of a triangle is from a triangle of another mesh.
double farthest(const Mesh& mesh, std::uint32_t triangle, const Mesh& other, std::uint32_t source) {
  const Mesh::Triangle& t = other.triangles[source];
  double distance = 0;
  for (const std::uint32_t v : mesh.triangles[triangle]) {
    const Vec3d& p = mesh.vertices[v];
    const Vec3d nearest =
        nearestOnTriangle(other.vertices[t[0]], other.vertices[t[1]], other.vertices[t[2]], p)
            .point;
    distance = std::max(distance, (p - nearest).length());
  }
  return distance;
}

/// Expects that every triangle of `made` that has a source lies within `tolerance_mm` of it.
/// Returns how many have one.
std::size_t expectNearSources(const DerivedMesh& made, const Mesh& given, double tolerance_mm) {
  EXPECT_EQ(made.source.size(), made.mesh.triangles.size());
  std::size_t count = 0;
  for (std::uint32_t i = 0; i < made.source.size(); ++i) {
    if (made.source[i] == no_source) continue;
    ++count;
    EXPECT_LE(farthest(made.mesh, i, given, made.source[i]), tolerance_mm) << i;
  }
  return count;
}

/// A ball of which every triangle stands alone, with some faults: a duplicate of the first triangle
/// and a degenerate one come first, and every seventh is turned round.
Mesh faultyBall(double noise_mm) {
  const Mesh ball = test::unshared(sphereMesh({1, 2, 3}, 1, 8));
  Mesh mesh = ball;
  std::mt19937 random(3);
  std::uniform_real_distribution<double> noise(-noise_mm, noise_mm);
  for (Vec3d& v : mesh.vertices) v += Vec3d(noise(random), noise(random), noise(random));
  mesh.triangles = {ball.triangles[5], {0, 0, 1}};
  mesh.triangles.insert(mesh.triangles.end(), ball.triangles.begin(), ball.triangles.end());
  for (std::size_t i = 2; i < mesh.triangles.size(); i += 7)
    std::swap(mesh.triangles[i][1], mesh.triangles[i][2]);
  return mesh;
}

TEST(SolidMesh, TrianglesOfAClosedMeshComeFromThemselves) {
  const Mesh sphere = sphereMesh({1, 2, 3}, 1, 8);
  const SolidMesh solid = solidMesh(sphere);
  EXPECT_EQ(solid.mesh.triangles, sphere.triangles);
  EXPECT_EQ(solid.source, countedFrom(0, sphere.triangles.size()));
  EXPECT_THAT(solid.report.repairs.lines(), IsEmpty());
  EXPECT_THAT(solid.walls.hidden, IsEmpty());
}

TEST(SolidMesh, WeldedAndTurnedTrianglesKeepTheirSource) {
  const Mesh given = faultyBall(2e-4);
  const SolidMesh solid = solidMesh(given);
  EXPECT_EQ(test::openSides(solid.mesh), 0U);
  EXPECT_GT(solid.report.repairs.welded_vertices, 0U);
  EXPECT_GT(solid.report.repairs.flipped_triangles, 0U);
  EXPECT_EQ(solid.report.repairs.degenerate_triangles, 1U);
  EXPECT_EQ(solid.report.repairs.duplicate_triangles, 1U);
  EXPECT_EQ(expectNearSources(solid, given, 1e-3), given.triangles.size() - 2);
}

TEST(SolidMesh, PartsThatWereInsideOutKeepTheirSource) {
  const Mesh given = joined({sphereMesh({0, 0, 0}, 1, 8), insideOut(sphereMesh({5, 0, 0}, 1, 8))});
  const SolidMesh solid = solidMesh(given);
  EXPECT_EQ(solid.report.repairs.turned_parts, 1U);
  EXPECT_EQ(solid.source, countedFrom(0, given.triangles.size()));
  EXPECT_EQ(expectNearSources(solid, given, 0), given.triangles.size());
}

TEST(SolidMesh, FillingsHaveNoSource) {
  Mesh given = sphereMesh({0, 0, 0}, 1, 12);
  given.triangles.erase(given.triangles.begin() + 30, given.triangles.begin() + 34);
  const SolidMesh solid = solidMesh(given);
  ASSERT_GT(solid.report.repairs.filling_triangles, 0U);
  const auto fillings = solid.source.begin() + static_cast<std::ptrdiff_t>(given.triangles.size());
  EXPECT_EQ(std::vector(solid.source.begin(), fillings), countedFrom(0, given.triangles.size()));
  EXPECT_EQ(solid.source.end() - fillings,
            static_cast<std::ptrdiff_t>(solid.report.repairs.filling_triangles));
  EXPECT_THAT(std::vector(fillings, solid.source.end()), Each(no_source));
}

TEST(SolidMesh, PiecesOfCutTrianglesLieInTheirSource) {
  // The duplicate in front shifts all sources.
  Mesh given = joined({boxMesh({0, 0, 0}, {2, 2, 2}), boxMesh({1, 1, 1}, {3, 3, 3})});
  given.triangles.insert(given.triangles.begin(), given.triangles.back());
  const SolidMesh solid = solidMesh(given);
  ASSERT_GT(solid.report.repairs.cut_triangles, 0U);
  const Mesh& pieces = solid.walls.pieces;
  ASSERT_FALSE(pieces.triangles.empty());
  for (std::uint32_t i = 0; i < pieces.triangles.size(); ++i) {
    const std::uint32_t source = solid.sourceOfPiece(i);
    ASSERT_NE(source, no_source);
    EXPECT_LT(farthest(pieces, i, given, source), 1e-9);
  }
}

TEST(SolidMesh, AGuessFollowsItsSourcesAndSpansGapsWithoutOne) {
  const Mesh given = test::pulledApart(sphereMesh({0, 0, 0}, 5, 6), 0.02);
  const SolidMesh solid = solidMesh(given);
  ASSERT_TRUE(solid.report.is_guess);
  EXPECT_EQ(test::openSides(solid.mesh), 0U);
  ASSERT_EQ(solid.report.guesses.size(), 1U);
  EXPECT_EQ(solid.report.guesses.front().loose.triangles, given.triangles.size());
  EXPECT_EQ(solid.report.guesses.front().loose.open_sides, 3 * given.triangles.size());
  // Corners lie in the cells about the places where the edges pierce the triangles.
  const double cell_mm = 10.0 / 64;
  const std::size_t count = expectNearSources(solid, given, 2 * std::sqrt(3) * cell_mm);
  EXPECT_GT(count, solid.source.size() / 2);
  EXPECT_LT(count, solid.source.size());
  std::vector<bool> is_followed(given.triangles.size(), false);
  for (const std::uint32_t source : solid.source)
    if (source != no_source) is_followed[source] = true;
  EXPECT_THAT(is_followed, Each(true));
}

TEST(SolidMesh, SourcesOfAGuessSkipDroppedTriangles) {
  Mesh given = test::pulledApart(boxMesh({0, 0, 0}, {4, 4, 4}), 0.02);
  given.triangles.insert(given.triangles.begin(), {0, 0, 1});
  const SolidMesh solid = solidMesh(given);
  ASSERT_TRUE(solid.report.is_guess);
  EXPECT_EQ(solid.report.repairs.degenerate_triangles, 1U);
  EXPECT_GT(expectNearSources(solid, given, 2 * std::sqrt(3) * 4 / 64), 0U);
  EXPECT_EQ(std::count(solid.source.begin(), solid.source.end(), 0U), 0);
}

TEST(SolidMesh, FillsLooseTrianglesWhereNoGuessIsWanted) {
  const Mesh given = test::pulledApart(boxMesh({0, 0, 0}, {4, 4, 4}), 0.02);
  const SolidMesh solid = solidMesh(given, {.guess = false});
  EXPECT_FALSE(solid.report.is_guess);
  EXPECT_EQ(test::openSides(solid.mesh), 0U);
  EXPECT_EQ(expectNearSources(solid, given, 0), given.triangles.size());
}

TEST(SolidMesh, AGuessCanBeRefusedBeforeItIsMade) {
  std::string text;
  SolidOptions options;
  options.before_guess = [&](const LooseTriangles& loose) {
    text = loose.text();
    throw DataError("refused");
  };
  options.progress = [](double) { ADD_FAILURE() << "a guess was begun"; };
  EXPECT_THROW(solidMesh(test::pulledApart(boxMesh({0, 0, 0}, {1, 1, 1}), 0.01), options),
               DataError);
  EXPECT_EQ(text, "36 of their 36 sides meet no other");
}

TEST(SolidMesh, RefusesTrianglesThatEncloseNothing) {
  Mesh sheet;
  sheet.vertices = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  sheet.triangles = {{0, 1, 2}};
  try {
    solidMesh(sheet);
    FAIL() << "no solid was refused";
  } catch (const DataError& error) {
    EXPECT_THAT(error.what(),
                HasSubstr("the triangles enclose nothing: 3 of their 3 sides meet no "
                          "other, and their winding number is above one half nowhere"));
  }
}

TEST(SolidMesh, RefusesTrianglesThatAreTooTangledToGuess) {
  EXPECT_THAT([] { solidMesh(test::randomTriangles(3, 6000)); },
              ThrowsMessage<DataError>(
                  "the triangles enclose nothing: 18000 of their 18000 sides meet no other, and "
                  "they are too tangled to guess the part; join them in a mesh editor first"));
}

TEST(SolidMesh, TrianglesThatCancelLeaveAnEmptyMesh) {
  Mesh mesh;
  mesh.vertices = {{0, 0, 0}, {1, 0, 0}};
  mesh.triangles = {{0, 1, 1}};
  const SolidMesh solid = solidMesh(mesh);
  EXPECT_THAT(solid.mesh.triangles, IsEmpty());
  EXPECT_THAT(solid.source, IsEmpty());
}

TEST(SolidBodies, SourcesCountThroughAllBodies) {
  Mesh open = boxMesh({10, 0, 0}, {12, 2, 2});
  open.triangles.erase(open.triangles.begin(), open.triangles.begin() + 2);
  const Mesh loose = test::pulledApart(boxMesh({20, 0, 0}, {24, 4, 4}), 0.02);
  const Mesh ball = sphereMesh({0, 0, 0}, 1, 8);
  const Mesh given = joined({loose, ball, open});
  const SolidBodies solids = solidBodies({loose, ball, open});
  ASSERT_EQ(solids.bodies.size(), 3U);
  EXPECT_TRUE(solids.bodies[0].report.is_guess);
  EXPECT_FALSE(solids.whole.report.is_guess);
  EXPECT_EQ(solids.whole.report.guesses.size(), 1U);
  EXPECT_EQ(solids.whole.report.repairs.closed_holes, 1U);
  EXPECT_EQ(solids.bodies[1].source, countedFrom(12, ball.triangles.size()));
  std::size_t triangles = 0;
  for (const SolidMesh& body : solids.bodies) {
    EXPECT_EQ(test::openSides(body.mesh), 0U);
    expectNearSources(body, given, 0.3);
    triangles += body.mesh.triangles.size();
  }
  EXPECT_EQ(solids.whole.mesh.triangles.size(), triangles);
  expectNearSources(solids.whole, given, 0.3);
}

TEST(SolidBodies, ARefusalNamesTheBody) {
  const Mesh bent{{{0, 0, 0}, {4, 0, 0}, {0, 4, 0}, {4, 4, 0}, {0, 0, 4}, {0, 4, 4}},
                  {{0, 1, 3}, {0, 3, 2}, {0, 4, 5}, {0, 5, 2}}};
  try {
    solidBodies({sphereMesh({0, 0, 0}, 1, 8), bent});
    FAIL() << "no body was refused";
  } catch (const DataError& error) {
    EXPECT_THAT(error.what(), testing::StartsWith("mesh 2 of 2: the triangles bound no volume: "));
  }
}

TEST(SolidBodies, OneBodyIsTheWhole) {
  const Mesh ball = sphereMesh({0, 0, 0}, 1, 8);
  const SolidBodies solids = solidBodies({ball});
  EXPECT_EQ(solids.whole.mesh.triangles, ball.triangles);
  EXPECT_THAT(solids.bodies, IsEmpty());
}

}  // namespace
}  // namespace vdbdither
