#include "io/mesh/polygon.h"

#include <cmath>
#include <numbers>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/shapes.h"

namespace vdbdither::test {
namespace {

using openvdb::Vec3d;

double area(const std::vector<Vec3d>& points, const Mesh::Triangle& triangle) {
  return (points[triangle[1]] - points[triangle[0]])
      .cross(points[triangle[2]] - points[triangle[0]])
      .z();
}

/// Triangles of a polygon without self-crossings cover it exactly if and only if none is turned
/// over: their signed areas add up to the polygon's in any case.
void expectCover(const std::vector<Vec3d>& points, const std::vector<std::uint32_t>& polygon) {
  std::vector<Mesh::Triangle> triangles;
  std::vector<Mesh::Triangle> places;
  triangulate(points, polygon, triangles, &places);
  ASSERT_EQ(triangles.size(), polygon.size() - 2);
  ASSERT_EQ(places.size(), triangles.size());
  for (std::size_t t = 0; t < places.size(); ++t) {
    for (std::size_t c = 0; c < 3; ++c) EXPECT_EQ(polygon[places[t][c]], triangles[t][c]);
  }
  for (const Mesh::Triangle& triangle : triangles) EXPECT_GE(area(points, triangle), 0.0);
}

TEST(Polygon, TriangulatesConcavePolygonsWithoutTurningATriangleOver) {
  std::mt19937 random(11);
  for (int round = 0; round < 300; ++round) {
    const auto corners = static_cast<std::uint32_t>(4 + random() % 60);
    std::vector<Vec3d> points;
    std::vector<std::uint32_t> polygon;
    for (std::uint32_t i = 0; i < corners; ++i) {
      const double angle = 2 * std::numbers::pi * i / corners;
      const double radius = 0.1 + static_cast<double>(random() % 1000);
      points.emplace_back(1e4 + radius * std::cos(angle), radius * std::sin(angle), 0.0);
      polygon.push_back(i);
    }
    expectCover(points, polygon);
  }
}

TEST(Polygon, TriangulatesAroundAHoleJoinedByASlit) {
  std::mt19937 random(13);
  for (int round = 0; round < 300; ++round) {
    const auto corners = static_cast<std::uint32_t>(3 + random() % 20);
    std::vector<Vec3d> points;
    std::vector<std::uint32_t> polygon;
    for (std::uint32_t i = 0; i < corners; ++i) {
      const double angle = 2 * std::numbers::pi * i / corners;
      const double radius = 5.0 + static_cast<double>(random() % 100);
      points.emplace_back(radius * std::cos(angle), radius * std::sin(angle), 0.0);
      polygon.push_back(i);
    }
    polygon.push_back(0);
    for (std::uint32_t i = 0; i <= corners; ++i) {  // the hole runs the other way, and returns
      polygon.push_back(corners + (corners - i) % corners);
    }
    for (std::uint32_t i = 0; i < corners; ++i) points.push_back(points[i] * 0.5);
    expectCover(points, polygon);
  }
}

TEST(Polygon, LiesInAnyPlane) {
  const std::vector<Vec3d> arrow{{0, 0, 0}, {4, 2, 0}, {0, 4, 0}, {1, 2, 0}};
  std::vector<Mesh::Triangle> flat;
  triangulate(arrow, std::vector<std::uint32_t>{0, 1, 2, 3}, flat);
  for (const Vec3d& degrees : {Vec3d(90, 0, 0), Vec3d(180, 0, 0), Vec3d(0, 90, 0), Vec3d(0, -90, 0),
                               Vec3d(35, 50, 70), Vec3d(-90, 0, 0)}) {
    const Mesh turned = transformed({arrow, {}}, degrees, {1, 2, 3});
    std::vector<Mesh::Triangle> triangles;
    triangulate(turned.vertices, std::vector<std::uint32_t>{0, 1, 2, 3}, triangles);
    EXPECT_EQ(triangles, flat);
  }
}

TEST(Polygon, KeepsTheNumberOfTrianglesOfASenselessPolygon) {
  const std::vector<Vec3d> points{{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 1}};
  std::vector<std::uint32_t> polygon;
  for (std::uint32_t i = 0; i < 400; ++i) polygon.push_back(i * i % 4);
  std::vector<Mesh::Triangle> triangles;
  triangulate(points, polygon, triangles);
  EXPECT_THAT(triangles, testing::SizeIs(398));
}

}  // namespace
}  // namespace vdbdither::test
