#pragma once

#include <optional>
#include <vector>

#include <openvdb/Types.h>

#include "vdbdither/model/lattice.h"
#include "vdbdither/model/mesh.h"

namespace vdbdither {

/// `meshes` in one, one after the other.
Mesh joined(std::vector<Mesh> meshes);

/// How a mesh comes to where it is printed.
struct MeshPlacement {
  openvdb::Vec3d rotate_degrees{0, 0, 0};  ///< about x, then y, then z; quarter turns are exact
  double factor = 1;                       ///< mm in a unit of the file
  double fit_mm = 0;                       ///< the longest axis, in place of the factor, if not 0
  std::optional<openvdb::Vec3d> corner_mm = std::nullopt;  ///< where the bounding box then begins
};

/// Where the bounding box of a part on the bed begins: at the lower faces of voxel (0, 0, 0), so
/// that a part as high as ten layers fills layers 0 to 9.
openvdb::Vec3d bedCornerMm(const Lattice& lattice);

/// Turns, scales, then moves. Returns the mm in a unit of the file. Throws DataError where a mesh
/// without extent is to fit.
double place(Mesh& mesh, const MeshPlacement& placement);

}  // namespace vdbdither
