#include "tests/bench/mesh_robustness/wall_costs.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <ctime>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include "ops/kernels/mesh/mesh_placement.h"
#include "ops/kernels/mesh/swallowed_walls.h"
#include "tests/support/shapes.h"

namespace {

using namespace vdbdither;
using openvdb::Vec3d;

using Shell = Mesh (*)(int index, int count, std::mt19937& random);

double between(double low, double high, std::mt19937& random) {
  return std::uniform_real_distribution<double>(low, high)(random);
}

Mesh ballOrBox(int index, const Vec3d& centre, std::mt19937& random) {
  if (index % 2 != 0) return test::sphereMesh(centre, 0.5, 4);
  return test::boxMesh(centre - Vec3d(between(0.3, 0.5, random)),
                       centre + Vec3d(between(0.3, 0.5, random)));
}

Mesh inARow(int index, int /*count*/, std::mt19937& random) {
  return ballOrBox(index, {0.6 * index, between(-0.2, 0.2, random), between(-0.2, 0.2, random)},
                   random);
}

Mesh ballAround(int index, int /*count*/, std::mt19937& /*random*/) {
  return test::sphereMesh({0, 0, 0}, 1 + 0.02 * index, 8);
}

/// Boxes that stand on one plane, each over some others.
Mesh onAPlane(int /*index*/, int count, std::mt19937& random) {
  const double across = 0.7 * std::sqrt(count);
  const Vec3d low(between(0, across, random), between(0, across, random), 0);
  return test::boxMesh(
      low, low + Vec3d(between(0.5, 1, random), between(0.5, 1, random), between(0.5, 1, random)));
}

/// Boxes like the bricks of a wall, each face to face with others.
Mesh faceToFace(int index, int count, std::mt19937& /*random*/) {
  const int across = static_cast<int>(std::ceil(std::sqrt(count)));
  const Vec3d low(index % across + 0.5 * (index / across % 2), std::floor(index / across), 0);
  return test::boxMesh(low, low + Vec3d(1.0));
}

Mesh inOnePlace(int index, int /*count*/, std::mt19937& random) {
  return ballOrBox(index, {between(0, 1, random), between(0, 1, random), between(0, 1, random)},
                   random);
}

/// A prism of eight sides.
Mesh rod(const Vec3d& from, const Vec3d& to, double radius) {
  constexpr std::uint32_t sides = 8;
  const Vec3d along = (to - from).unit();
  const Vec3d across = along.getArbPerpendicular();
  const Vec3d aside = along.cross(across);
  Mesh mesh;
  mesh.vertices = {from, to};
  for (std::uint32_t i = 0; i < sides; ++i) {
    const double angle = 2 * std::numbers::pi * i / sides;
    const Vec3d out = radius * (std::cos(angle) * across + std::sin(angle) * aside);
    mesh.vertices.push_back(from + out);
    mesh.vertices.push_back(to + out);
    const std::uint32_t low = 2 + 2 * i;
    const std::uint32_t next = 2 + 2 * ((i + 1) % sides);
    mesh.triangles.insert(
        mesh.triangles.end(),
        {{0, next, low}, {1, low + 1, next + 1}, {low, next, next + 1}, {low, next + 1, low + 1}});
  }
  return mesh;
}

/// Rods between the corners of cubes and along their diagonals, as in a light structure.
Mesh ofALattice(int index, int count, std::mt19937& /*random*/) {
  static const std::array<Vec3d, 7> ways{Vec3d(1, 0, 0), Vec3d(0, 1, 0),  Vec3d(0, 0, 1),
                                         Vec3d(1, 1, 1), Vec3d(-1, 1, 1), Vec3d(1, -1, 1),
                                         Vec3d(1, 1, -1)};
  const int edge = static_cast<int>(std::ceil(std::cbrt(count / 7.0)));
  const int cell = index / 7;
  const Vec3d corner(cell % edge, cell / edge % edge, std::floor(cell / (edge * edge)));
  return rod(corner, corner + ways[static_cast<std::size_t>(index % 7)], 0.1);
}

struct Row {
  const char* name;
  Shell shell;
  int count;
  Mesh mesh{};
  SwallowedWalls walls{};
  std::vector<double> cpu_seconds{}, seconds{};
};

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

void measure(Row& row) {
  const std::clock_t cpu = std::clock();
  const auto start = std::chrono::steady_clock::now();
  row.walls = swallowedWalls(row.mesh);
  const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - start;
  row.seconds.push_back(seconds.count());
  row.cpu_seconds.push_back(static_cast<double>(std::clock() - cpu) / CLOCKS_PER_SEC);
}

}  // namespace

void printWallCosts() {
  constexpr int runs = 5;
  std::vector<Row> rows;
  for (const int count : {400, 1600, 6400}) rows.push_back({"in a row", inARow, count});
  for (const int count : {50, 214, 428}) rows.push_back({"within each other", ballAround, count});
  for (const int count : {1000, 4000, 16000}) rows.push_back({"on one plane", onAPlane, count});
  for (const int count : {1000, 4000, 16000}) rows.push_back({"face to face", faceToFace, count});
  for (const int count : {80, 160, 320}) rows.push_back({"in one place", inOnePlace, count});
  for (const int count : {189, 448, 1512}) rows.push_back({"of a lattice", ofALattice, count});
  for (Row& row : rows) {
    std::mt19937 random(1);
    std::vector<Mesh> shells;
    for (int i = 0; i < row.count; ++i) shells.push_back(row.shell(i, row.count, random));
    row.mesh = joined(std::move(shells));
  }
  for (int run = 0; run < runs; ++run)
    for (Row& row : rows) measure(row);
  std::printf(
      "| shells | number | triangles | hidden | cut | pieces | CPU, s | s |\n"
      "|---|---|---|---|---|---|---|---|\n");
  for (const Row& row : rows)
    std::printf("| %s | %d | %zu | %zu | %zu | %zu | %.2f | %.2f |\n", row.name, row.count,
                row.mesh.triangles.size(), static_cast<std::size_t>(row.walls.swallowed),
                static_cast<std::size_t>(row.walls.cut), row.walls.pieces.triangles.size(),
                median(row.cpu_seconds), median(row.seconds));
}
