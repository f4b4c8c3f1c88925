#include "ops/kernels/mesh/mesh_measures.h"

#include <optional>

namespace vdbdither {

using openvdb::Vec3d;

MeshBounds boundsOf(std::span<const Mesh> meshes) {
  std::optional<MeshBounds> bounds;
  for (const Mesh& mesh : meshes)
    for (const Vec3d& vertex : mesh.vertices) {
      if (!bounds) bounds = {vertex, vertex};
      bounds->min = openvdb::math::minComponent(bounds->min, vertex);
      bounds->max = openvdb::math::maxComponent(bounds->max, vertex);
    }
  return bounds.value();
}

double areaOf(const Mesh& mesh) {
  double sum = 0;
  for (const Mesh::Triangle& t : mesh.triangles) {
    const Vec3d& a = mesh.vertices[t[0]];
    sum += 0.5 * (mesh.vertices[t[1]] - a).cross(mesh.vertices[t[2]] - a).length();
  }
  return sum;
}

double volumeOf(const Mesh& mesh) {
  // From a corner of the mesh, so that a far origin costs no digits.
  const Vec3d from = mesh.vertices.empty() ? Vec3d(0.0) : mesh.vertices.front();
  double sum = 0;
  for (const Mesh::Triangle& t : mesh.triangles) sum += volumeFrom(from, mesh, t);
  return sum;
}

}  // namespace vdbdither
