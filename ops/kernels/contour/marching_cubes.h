#pragma once

#include <array>
#include <cstdint>
#include <vector>

namespace vdbdither {

/// Marching cubes (Lorensen, Cline: "Marching Cubes", 1987) for one cell whose corners are inside
/// or outside. Corner x + 2y + 4z; the edges are numbered 0–3 along x (y + 2z), 4–7 along y (x +
/// 2z), 8–11 along z (x + 2y).
struct CubeCase {
  std::uint16_t edges = 0;  ///< bit e: the surface cuts edge e
  /// By edges, counter-clockwise seen from outside.
  std::vector<std::array<std::uint8_t, 3>> triangles;
};

/// The cases by which corners are inside, bit by corner.
///
/// The table is derived, not listed: where two inside corners of a face lie diagonally, every cell
/// joins them, so that the cells on both sides of the face agree, and voxels that share an edge are
/// one piece. Polygons are cut into triangles along the shortest diagonals that lie in no face. So
/// the surface of any field is a closed manifold: each side of a triangle is met by exactly one
/// other, in the opposite direction, and the triangles at a vertex form one ring.
const std::array<CubeCase, 256>& cubeCases();

}  // namespace vdbdither
