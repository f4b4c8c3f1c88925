#include "tests/support/shapes.h"

#include <cmath>
#include <numbers>
#include <random>
#include <utility>

namespace vdbdither::test {

using openvdb::Vec3d;

namespace {

/// Adds two triangles of the quad a, b, c, d (counter-clockwise seen from outside).
void addQuad(Mesh& mesh, std::uint32_t a, std::uint32_t b, std::uint32_t c, std::uint32_t d) {
  mesh.triangles.push_back({a, b, c});
  mesh.triangles.push_back({a, c, d});
}

}  // namespace

Mesh boxMesh(const Vec3d& min, const Vec3d& max) {
  Mesh mesh;
  for (int corner = 0; corner < 8; ++corner) {
    mesh.vertices.emplace_back((corner & 1) ? max.x() : min.x(), (corner & 2) ? max.y() : min.y(),
                               (corner & 4) ? max.z() : min.z());
  }
  addQuad(mesh, 0, 2, 3, 1);
  addQuad(mesh, 4, 5, 7, 6);
  addQuad(mesh, 0, 1, 5, 4);
  addQuad(mesh, 2, 6, 7, 3);
  addQuad(mesh, 0, 4, 6, 2);
  addQuad(mesh, 1, 3, 7, 5);
  return mesh;
}

Mesh sphereMesh(const Vec3d& centre, double radius, int rings) {
  Mesh mesh;
  const int segments = 2 * rings;
  const auto index = [&](int ring, int segment) {
    return static_cast<std::uint32_t>(1 + (ring - 1) * segments + segment % segments);
  };
  mesh.vertices.push_back(centre + Vec3d(0, 0, radius));
  for (int ring = 1; ring < rings; ++ring) {
    const double polar = std::numbers::pi * ring / rings;
    for (int segment = 0; segment < segments; ++segment) {
      const double azimuth = 2 * std::numbers::pi * segment / segments;
      mesh.vertices.push_back(centre + radius * Vec3d(std::sin(polar) * std::cos(azimuth),
                                                      std::sin(polar) * std::sin(azimuth),
                                                      std::cos(polar)));
    }
  }
  mesh.vertices.push_back(centre - Vec3d(0, 0, radius));
  const auto south = static_cast<std::uint32_t>(mesh.vertices.size() - 1);
  for (int segment = 0; segment < segments; ++segment) {
    mesh.triangles.push_back({0, index(1, segment), index(1, segment + 1)});
    mesh.triangles.push_back({south, index(rings - 1, segment + 1), index(rings - 1, segment)});
    for (int ring = 1; ring + 1 < rings; ++ring) {
      addQuad(mesh, index(ring, segment), index(ring + 1, segment), index(ring + 1, segment + 1),
              index(ring, segment + 1));
    }
  }
  return mesh;
}

Mesh torusMesh(const Vec3d& centre, double ring_radius, double tube_radius, int rings) {
  Mesh mesh;
  const int tubes = rings / 2;
  const auto index = [&](int ring, int tube) {
    return static_cast<std::uint32_t>((ring % rings) * tubes + tube % tubes);
  };
  for (int ring = 0; ring < rings; ++ring) {
    const double azimuth = 2 * std::numbers::pi * ring / rings;
    for (int tube = 0; tube < tubes; ++tube) {
      const double around = 2 * std::numbers::pi * tube / tubes;
      const double reach = ring_radius + tube_radius * std::cos(around);
      mesh.vertices.push_back(centre + Vec3d(reach * std::cos(azimuth), reach * std::sin(azimuth),
                                             tube_radius * std::sin(around)));
    }
  }
  for (int ring = 0; ring < rings; ++ring) {
    for (int tube = 0; tube < tubes; ++tube) {
      addQuad(mesh, index(ring, tube), index(ring + 1, tube), index(ring + 1, tube + 1),
              index(ring, tube + 1));
    }
  }
  return mesh;
}

Mesh transformed(Mesh mesh, const Vec3d& degrees, const Vec3d& move) {
  for (Vec3d& vertex : mesh.vertices) {
    for (int axis = 0; axis < 3; ++axis) {
      const double angle = degrees[axis] * std::numbers::pi / 180;
      const int u = (axis + 1) % 3;
      const int v = (axis + 2) % 3;
      const double turned = std::cos(angle) * vertex[u] - std::sin(angle) * vertex[v];
      vertex[v] = std::sin(angle) * vertex[u] + std::cos(angle) * vertex[v];
      vertex[u] = turned;
    }
    vertex += move;
  }
  return mesh;
}

Mesh insideOut(Mesh mesh) {
  for (Mesh::Triangle& t : mesh.triangles) std::swap(t[1], t[2]);
  return mesh;
}

Mesh unshared(const Mesh& mesh) {
  Mesh apart;
  for (const Mesh::Triangle& t : mesh.triangles) {
    const auto first = static_cast<std::uint32_t>(apart.vertices.size());
    for (const std::uint32_t v : t) apart.vertices.push_back(mesh.vertices[v]);
    apart.triangles.push_back({first, first + 1, first + 2});
  }
  return apart;
}

Mesh pulledApart(const Mesh& mesh, double gap_mm) {
  Mesh loose = unshared(mesh);
  for (const Mesh::Triangle& t : loose.triangles) {
    const Vec3d middle = (loose.vertices[t[0]] + loose.vertices[t[1]] + loose.vertices[t[2]]) / 3;
    for (const std::uint32_t v : t) {
      const Vec3d inwards = middle - loose.vertices[v];
      loose.vertices[v] += inwards * (gap_mm / inwards.length());
    }
  }
  return loose;
}

Mesh randomTriangles(unsigned seed, int count) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> uniform(0, 10);
  Mesh mesh;
  for (int i = 0; i < count; ++i) {
    const auto first = static_cast<std::uint32_t>(mesh.vertices.size());
    for (int corner = 0; corner < 3; ++corner)
      mesh.vertices.emplace_back(uniform(random), uniform(random), uniform(random));
    mesh.triangles.push_back({first, first + 1, first + 2});
  }
  return mesh;
}

}  // namespace vdbdither::test
