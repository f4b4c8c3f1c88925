#pragma once

#include <array>
#include <cstdint>
#include <vector>

namespace vdbdither {

/// The surface in one cell whose corners are inside or outside (marching cubes, Lorensen, Cline
/// 1987). Corner (x, y, z) is number x + 2y + 4z; edges 0–3 lie along x (y + 2z), 4–7 along y (x +
/// 2z), 8–11 along z (x + 2y).
struct CubeCase {
  std::uint16_t edges = 0;  ///< bit e: the surface cuts edge e
  /// Their corners' edges, counter-clockwise seen from outside.
  std::vector<std::array<std::uint8_t, 3>> triangles;
};

/// Returns the cases by the corners that are inside, one bit per corner.
///
/// The table is computed from two rules. If two inside corners of a face are diagonal, every cell
/// joins them, so that the cells on both sides of the face agree and voxels that share an edge are
/// one piece. Polygons are cut into triangles along the shortest diagonals that do not lie in a
/// face. The surface of any field is therefore a closed manifold: each side of a triangle is met by
/// exactly one other, in the opposite direction, and the triangles at a vertex form one ring.
const std::array<CubeCase, 256>& cubeCases();

}  // namespace vdbdither
