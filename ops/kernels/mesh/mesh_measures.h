#pragma once

#include <span>

#include <openvdb/math/Vec3.h>

#include "vdbdither/model/mesh.h"

namespace vdbdither {

/// The bounding box of a mesh.
struct MeshBounds {
  openvdb::Vec3d min, max;
};

/// Returns the bounds of all vertices, of which there must be one.
MeshBounds boundsOf(std::span<const Mesh> meshes);
inline MeshBounds boundsOf(const Mesh& mesh) { return boundsOf(std::span(&mesh, 1)); }

/// Returns the area of all triangles, mm².
double areaOf(const Mesh& mesh);

/// Returns the enclosed volume, mm³; positive where the triangles face outwards.
double volumeOf(const Mesh& mesh);

/// Returns the share of one triangle in that volume, mm³: the signed volume between it and the
/// point `from`, which must be the same for all triangles.
inline double volumeFrom(const openvdb::Vec3d& from, const Mesh& mesh, const Mesh::Triangle& t) {
  const openvdb::Vec3d a = mesh.vertices[t[0]] - from;
  const openvdb::Vec3d b = mesh.vertices[t[1]] - from;
  const openvdb::Vec3d c = mesh.vertices[t[2]] - from;
  return a.dot(b.cross(c)) / 6;
}

}  // namespace vdbdither
