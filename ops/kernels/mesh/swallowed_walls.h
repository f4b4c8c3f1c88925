#pragma once

#include <cstdint>
#include <vector>

#include "vdbdither/model/mesh.h"

namespace vdbdither {

/// What of a mesh is not surface of the solid that it bounds: walls of shells that overlap, folds
/// that pass through another wall, membranes between coinciding faces.
struct SwallowedWalls {
  std::vector<bool> hidden;  ///< by triangle: no surface, or replaced by pieces; empty for none
  Mesh pieces;               ///< what others leave of the triangles that they cut
  std::vector<std::uint32_t> piece_of;  ///< by piece: the triangle
  std::uint64_t swallowed = 0;          ///< triangles of which nothing is left
  std::uint64_t cut = 0;                ///< triangles of which pieces are left
};

/// Returns the walls of `mesh` (in mm, closed) within its solid, which is where the winding number
/// is not zero. Triangles that others meet are cut where these pass; the cuts are exact to
/// rounding. The result is the same for any number of threads. Throws Interrupted.
SwallowedWalls swallowedWalls(const Mesh& mesh);

}  // namespace vdbdither
