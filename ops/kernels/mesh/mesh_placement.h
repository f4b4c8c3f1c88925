#pragma once

#include <vector>

#include <openvdb/Types.h>

#include "vdbdither/model/mesh.h"

namespace vdbdither {

/// `meshes` in one, one after the other.
Mesh joined(std::vector<Mesh> meshes);

/// How a mesh comes to where it is printed.
struct MeshPlacement {
  openvdb::Vec3d rotate_degrees{0, 0, 0};  ///< about x, then y, then z; quarter turns are exact
  double factor = 1;                       ///< mm in a unit of the file
  double fit_mm = 0;                       ///< the longest axis, in place of the factor, if not 0
  bool on_bed = false;                     ///< the bounding box then begins at the origin
};

/// Turns, scales, then moves. Throws DataError where a mesh without extent is to fit.
void place(Mesh& mesh, const MeshPlacement& placement);

}  // namespace vdbdither
