#pragma once

#include <array>
#include <span>
#include <string_view>
#include <utility>
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

/// Turns, scales, then moves meshes as one. Throws DataError where meshes without extent have to
/// fit.
void place(std::span<Mesh> meshes, const MeshPlacement& placement);
inline void place(Mesh& mesh, const MeshPlacement& placement) {
  place(std::span(&mesh, 1), placement);
}

/// The units that a mesh's numbers can be in, and mm in each.
inline constexpr std::array<std::pair<std::string_view, double>, 5> units_mm{
    {{"mm", 1.0}, {"cm", 10.0}, {"m", 1000.0}, {"in", 25.4}, {"um", 0.001}}};

/// Mm in `unit`, one of them.
double unitMm(std::string_view unit);

}  // namespace vdbdither
