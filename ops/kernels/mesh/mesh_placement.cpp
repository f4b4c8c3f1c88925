#include "ops/kernels/mesh/mesh_placement.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "ops/kernels/mesh/mesh_measures.h"
#include "vdbdither/model/errors.h"

namespace vdbdither {

using openvdb::Vec3d;

namespace {

void rotate(Mesh& mesh, const Vec3d& degrees) {
  for (int axis = 0; axis < 3; ++axis) {
    const double turn = std::remainder(degrees[axis], 360.0);
    if (turn == 0) continue;
    const bool quarters = std::fmod(turn, 90.0) == 0;
    const double angle = turn * std::numbers::pi / 180;
    const double cosine = quarters ? std::round(std::cos(angle)) : std::cos(angle);
    const double sine = quarters ? std::round(std::sin(angle)) : std::sin(angle);
    const int u = (axis + 1) % 3;
    const int v = (axis + 2) % 3;
    for (Vec3d& p : mesh.vertices) {
      const double turned = cosine * p[u] - sine * p[v];
      p[v] = sine * p[u] + cosine * p[v];
      p[u] = turned;
    }
  }
}

}  // namespace

Mesh joined(std::vector<Mesh> meshes) {
  if (meshes.empty()) return {};
  Mesh all = std::move(meshes.front());
  for (auto mesh = meshes.begin() + 1; mesh != meshes.end(); ++mesh) {
    const auto first = static_cast<std::uint32_t>(all.vertices.size());
    all.vertices.insert(all.vertices.end(), mesh->vertices.begin(), mesh->vertices.end());
    for (const Mesh::Triangle& t : mesh->triangles)
      all.triangles.push_back({t[0] + first, t[1] + first, t[2] + first});
  }
  return all;
}

Vec3d bedCornerMm(const Lattice& lattice) { return lattice.origin_mm - 0.5 * lattice.pitch_mm; }

double place(std::span<Mesh> meshes, const MeshPlacement& placement) {
  double factor = placement.factor;
  for (Mesh& mesh : meshes) rotate(mesh, placement.rotate_degrees);
  if (placement.fit_mm > 0) {
    const MeshBounds bounds = boundsOf(meshes);
    const Vec3d extent = bounds.max - bounds.min;
    const double longest = std::max({extent.x(), extent.y(), extent.z()});
    if (!(longest > 0)) throw DataError("--fit: the mesh has no extent");
    factor = placement.fit_mm / longest;
  }
  for (Mesh& mesh : meshes)
    for (Vec3d& vertex : mesh.vertices) vertex *= factor;
  if (placement.corner_mm) {
    const Vec3d move_mm = *placement.corner_mm - boundsOf(meshes).min;
    for (Mesh& mesh : meshes)
      for (Vec3d& vertex : mesh.vertices) vertex += move_mm;
  }
  return factor;
}

}  // namespace vdbdither
