#pragma once

#include <span>
#include <vector>

#include <openvdb/Types.h>

#include "vdbdither/model/mesh.h"

namespace vdbdither {

/// Returns `meshes` as one mesh, one after the other.
Mesh joined(std::vector<Mesh> meshes);

/// The place of a mesh in the printer.
struct MeshPlacement {
  openvdb::Vec3d rotate_degrees{0, 0, 0};  ///< about x, then y, then z; quarter turns are exact
  double factor = 1;                       ///< mm per unit of the file
  double fit_mm = 0;    ///< the length of the longest axis; replaces the factor if not 0
  bool on_bed = false;  ///< moves the bounding box to begin at the origin
};

/// Rotates, scales, then moves meshes as one. Throws DataError if `fit_mm` is set and the meshes
/// have no extent.
void place(std::span<Mesh> meshes, const MeshPlacement& placement);
inline void place(Mesh& mesh, const MeshPlacement& placement) {
  place(std::span(&mesh, 1), placement);
}

}  // namespace vdbdither
