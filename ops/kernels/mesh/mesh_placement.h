#pragma once

#include <optional>
#include <span>
#include <vector>

#include <openvdb/Types.h>

#include "vdbdither/model/lattice.h"
#include "vdbdither/model/mesh.h"

namespace vdbdither {

/// Returns `meshes` as one mesh, one after the other.
Mesh joined(std::vector<Mesh> meshes);

/// The place of a mesh in the printer.
struct MeshPlacement {
  openvdb::Vec3d rotate_degrees{0, 0, 0};  ///< about x, then y, then z; quarter turns are exact
  double factor = 1;                       ///< mm per unit of the file
  double fit_mm = 0;  ///< the length of the longest axis; replaces the factor if not 0
  std::optional<openvdb::Vec3d> corner_mm = std::nullopt;  ///< moves the bounding box to begin here
};

/// Returns where the bounding box of a part on the bed begins: at the lower faces of voxel
/// (0, 0, 0), so that a part as high as ten layers fills the layers 0 to 9.
openvdb::Vec3d bedCornerMm(const Lattice& lattice);

/// Rotates, scales, then moves meshes as one. Returns the mm per unit of the file. Throws DataError
/// if `fit_mm` is set and the meshes have no extent.
double place(std::span<Mesh> meshes, const MeshPlacement& placement);
inline double place(Mesh& mesh, const MeshPlacement& placement) {
  return place(std::span(&mesh, 1), placement);
}

}  // namespace vdbdither
