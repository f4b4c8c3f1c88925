#pragma once

#include <openvdb/Types.h>

#include "vdbdither/model/mesh.h"

namespace vdbdither::test {

/// Closed, outward oriented meshes in mm, their vertices shared.
Mesh boxMesh(const openvdb::Vec3d& min, const openvdb::Vec3d& max);

/// A latitude-longitude sphere with `rings` bands of `2 * rings` quads; its vertices lie on the
/// sphere.
Mesh sphereMesh(const openvdb::Vec3d& centre, double radius, int rings);

/// A torus around the z axis; `rings` segments around the axis, half as many around the tube.
Mesh torusMesh(const openvdb::Vec3d& centre, double ring_radius, double tube_radius, int rings);

/// Returns `mesh` rotated about the axes x, then y, then z (degrees), then moved.
Mesh transformed(Mesh mesh, const openvdb::Vec3d& degrees, const openvdb::Vec3d& move);

/// `mesh` with every triangle turned round.
Mesh insideOut(Mesh mesh);

/// `mesh` without shared vertices.
Mesh unshared(const Mesh& mesh);

/// The same, with every triangle drawn towards its centroid: corners move by `gap_mm`.
Mesh pulledApart(const Mesh& mesh, double gap_mm);

/// Triangles with random corners in a cube from 0 to 10 mm, none of which share a corner.
Mesh randomTriangles(unsigned seed, int count);

}  // namespace vdbdither::test
