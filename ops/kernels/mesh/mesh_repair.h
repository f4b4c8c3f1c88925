#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "ops/kernels/mesh/derived_mesh.h"

namespace vdbdither {

/// Counts of the repairs of a mesh; all zero for a mesh that needs none.
struct MeshRepairs {
  std::uint64_t welded_vertices = 0;       ///< merged with another within a micrometre, at borders
  std::uint64_t degenerate_triangles = 0;  ///< dropped: two corners are one
  std::uint64_t duplicate_triangles = 0;  ///< dropped: the same corners as another, or its opposite
  std::uint64_t flipped_triangles = 0;    ///< turned to agree with their neighbours
  std::uint64_t turned_parts = 0;         ///< parts that were inside out
  std::uint64_t boundary_edges = 0;       ///< sides that no opposite side meets
  std::uint64_t closed_holes = 0;         ///< loops of boundary edges that were filled
  std::uint64_t filling_triangles = 0;    ///< in the fillings; they are the last of the mesh
  std::uint64_t swallowed_triangles = 0;  ///< not surface: wholly within the solid
  std::uint64_t cut_triangles = 0;        ///< partly within the solid

  /// Whether more than half of the sides were open, so that fillings say nothing about the solid.
  /// `triangles` is the number in the repaired mesh.
  [[nodiscard]] bool areOfLooseTriangles(std::size_t triangles) const {
    return 2 * boundary_edges > 3 * (triangles - filling_triangles);
  }

  /// Returns one line for each kind of repair that occurred.
  [[nodiscard]] std::vector<std::string> lines() const;
};

/// A mesh that bounds a solid: every side of a triangle is met by one in the opposite direction, so
/// that the winding number is a whole number everywhere, and positive within parts that are not
/// cavities.
///
/// Vertices at the same position become one (this does not count as a repair: file formats without
/// shared vertices need it); at borders also those within a micrometre. Degenerate and duplicate
/// triangles are dropped. Triangles are turned to agree with their neighbours, parts that are
/// inside out and in no other part are turned, and loops of borders are filled; see hole_filling.h.
/// Triangles keep their order and their sources, those of fillings come last and have none. All
/// vertices stay, new ones come last. Deterministic.
///
/// `triangles` in mm.
DerivedMesh repaired(DerivedMesh triangles, MeshRepairs& repairs);

/// The first steps of `repaired` alone: vertices at the same position become one, and degenerate
/// and duplicate triangles are dropped.
DerivedMesh withoutDuplicates(DerivedMesh triangles, MeshRepairs& repairs);

}  // namespace vdbdither
