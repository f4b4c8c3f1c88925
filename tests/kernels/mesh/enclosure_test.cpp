#include "ops/kernels/mesh/enclosure.h"

#include <cmath>
#include <cstdint>
#include <functional>
#include <map>
#include <numbers>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "ops/kernels/mesh/mesh_placement.h"
#include "ops/kernels/mesh/solid_mesh.h"
#include "tests/support/shapes.h"
#include "vdbdither/model/errors.h"

namespace vdbdither {
namespace {

using openvdb::Vec3d;
using test::boxMesh;
using test::sphereMesh;
using testing::HasSubstr;

/// A grid of `columns` × `rows` cells, its corners at `at` of fractions from 0 to 1. Columns
/// that close join their ends, and the last is twisted if `twisted`.
Mesh sheet(std::uint32_t columns, std::uint32_t rows,
           const std::function<Vec3d(double, double)>& at, bool closes = false,
           bool twisted = false) {
  Mesh mesh;
  for (std::uint32_t i = 0; i <= columns - closes; ++i)
    for (std::uint32_t j = 0; j <= rows; ++j)
      mesh.vertices.push_back(at(static_cast<double>(i) / columns, static_cast<double>(j) / rows));
  const auto vertex = [&](std::uint32_t i, std::uint32_t j) {
    if (!closes || i < columns) return i * (rows + 1) + j;
    return twisted ? rows - j : j;
  };
  for (std::uint32_t i = 0; i < columns; ++i)
    for (std::uint32_t j = 0; j < rows; ++j) {
      mesh.triangles.push_back({vertex(i, j), vertex(i + 1, j), vertex(i + 1, j + 1)});
      mesh.triangles.push_back({vertex(i, j), vertex(i + 1, j + 1), vertex(i, j + 1)});
    }
  return mesh;
}

Vec3d onCircle(double turn, double radius, double z) {
  const double angle = 2 * std::numbers::pi * turn;
  return {radius * std::cos(angle), radius * std::sin(angle), z};
}

Mesh moebiusStrip() {
  return sheet(
      60, 4,
      [](double turn, double across) {
        const double tilt = std::numbers::pi * turn;
        return onCircle(turn, 5 + 2 * (across - 0.5) * std::cos(tilt),
                        2 * (across - 0.5) * std::sin(tilt));
      },
      true, true);
}

Mesh tube(double height) {
  return sheet(
      40, 6, [&](double turn, double up) { return onCircle(turn, 1, height * up); }, true);
}

Mesh waves() {
  return sheet(30, 30, [](double x, double y) {
    return Vec3d(10 * x, 10 * y, std::sin(12 * x) * std::sin(12 * y));
  });
}

/// The part of a sphere of radius 1 up to `angle` from its pole.
Mesh cap(double angle) {
  return sheet(
      24, 12,
      [&](double turn, double down) {
        const double at = angle * (down + 0.01) / 1.01;
        return onCircle(turn, std::sin(at), std::cos(at));
      },
      true);
}

std::string refusal(const Mesh& mesh) {
  try {
    solidMesh(mesh);
  } catch (const DataError& error) {
    return error.what();
  }
  return "made";
}

TEST(Enclosure, SurfacesThatBoundNothingAreRefused) {
  const auto flat = [](double z) {
    return sheet(9, 9, [z](double x, double y) { return Vec3d(x, y, z); });
  };
  const std::map<std::string, Mesh> meshes{{"strip", moebiusStrip()},
                                           {"hoop", tube(0.3)},
                                           {"waves", waves()},
                                           {"shallow cap", cap(0.3)},
                                           {"two sheets", joined({flat(0), flat(1)})}};
  for (const auto& [name, mesh] : meshes) {
    SCOPED_TRACE(name);
    const std::string message = refusal(mesh);
    EXPECT_THAT(message, HasSubstr("the triangles bound no volume: "));
    EXPECT_EQ(message.find("one-sided") != std::string::npos, name == "strip") << message;
  }
}

TEST(Enclosure, TheRefusalTellsAreas) {
  EXPECT_THAT(refusal(tube(0.25)),
              testing::MatchesRegex("the triangles bound no volume: 2 holes would be filled with "
                                    "6\\.2[0-9] mm2 beside 1\\.5[0-9] mm2 of surface; close the "
                                    "surface or give it a thickness in a mesh editor first"));
}

TEST(Enclosure, OpenSurfacesThatBoundAVolumeAreClosed) {
  Mesh five_faces = boxMesh({0, 0, 0}, {1, 1, 1});
  five_faces.triangles.resize(10);
  Mesh half_faces = boxMesh({0, 0, 0}, {4, 4, 4});
  half_faces.triangles.erase(half_faces.triangles.begin() + 3);
  const std::map<std::string, Mesh> meshes{{"hemisphere", cap(std::numbers::pi / 2)},
                                           {"tube", tube(2)},
                                           {"long tube", tube(10)},
                                           {"five faces", five_faces},
                                           {"a face missing", half_faces},
                                           {"ball", sphereMesh({1, 2, 3}, 4, 10)}};
  for (const auto& [name, mesh] : meshes) EXPECT_EQ(refusal(mesh), "made") << name;
}

TEST(Enclosure, IsNotAskedWhereNoGuessIsWanted) {
  EXPECT_NO_THROW(solidMesh(waves(), {.guess = false}));
}

TEST(Enclosure, AShareIsTheSameInEveryRun) {
  const SolidMesh solid = solidMesh(tube(2));
  const std::size_t fillings = solid.report.repairs.filling_triangles;
  const Enclosure once = enclosureOf(solid.mesh, fillings);
  EXPECT_EQ(once.share, enclosureOf(solid.mesh, fillings).share);
  EXPECT_NEAR(once.share, 0.75, 0.1);
  EXPECT_NEAR(once.filling_mm2, 2 * std::numbers::pi, 0.1);
  EXPECT_NEAR(once.given_mm2, 4 * std::numbers::pi, 0.1);
  EXPECT_FALSE(once.is_one_sided);
}

TEST(WhyFlat, TellsWhyTrianglesCannotBoundAVolume) {
  EXPECT_EQ(whyFlat(boxMesh({0, 0, 0}, {1, 1, 1})), "");
  EXPECT_EQ(whyFlat(waves()), "");
  Mesh few = boxMesh({0, 0, 0}, {1, 1, 1});
  few.triangles.resize(3);
  EXPECT_EQ(whyFlat(few), "it has only 3 triangles with an area, and 4 are needed");
  few.triangles.resize(1);
  EXPECT_EQ(whyFlat(few), "it has only 1 triangle with an area, and 4 are needed");
  const auto flat = [](const std::function<Vec3d(double, double)>& at) {
    Mesh mesh = sheet(9, 9, at);
    for (Vec3d& vertex : mesh.vertices) vertex = Vec3d(openvdb::Vec3s(vertex));
    return whyFlat(mesh);
  };
  EXPECT_EQ(flat([](double, double) { return Vec3d(1, 2, 3); }),
            "it has only 0 triangles with an area, and 4 are needed");
  EXPECT_EQ(flat([](double u, double v) { return Vec3d(u + v, 0.3 * (u + v), 7); }),
            "all its corners lie in one line");
  for (const double far : {0.0, 1.0, 1000.0})
    EXPECT_EQ(flat([&](double u, double v) {
                return Vec3d(far + 3 * u, 0.7 * u - 0.3 * v, far - 0.1 * u + 2 * v);
              }),
              "all its corners lie in one plane")
        << far;
}

TEST(WhyFlat, APlateThatIsThinButNoSheetMayBoundAVolume) {
  EXPECT_EQ(whyFlat(boxMesh({0, 0, 0}, {300, 300, 0.01})), "");
  EXPECT_EQ(whyFlat(boxMesh({900, 900, 900}, {1000, 1000, 900.01})), "");
}

}  // namespace
}  // namespace vdbdither
