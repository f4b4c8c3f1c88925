#pragma once

// The mesh family: kernels on triangle meshes; placing, measuring, repairing and closing them.

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "ops/kernels/mesh/derived_mesh.h"
#include "ops/kernels/mesh/mesh_repair.h"
#include "ops/kernels/mesh/swallowed_walls.h"
#include "vdbdither/model/mesh.h"

namespace vdbdither {

/// Triangles that enclose nothing: more than half of their sides meet no other.
struct LooseTriangles {
  std::uint64_t triangles = 0;
  std::uint64_t open_sides = 0;
  std::uint64_t sides = 0;

  /// "N of their M sides meet no other".
  [[nodiscard]] std::string text() const;
};

/// A surface that was guessed from loose triangles; see windingSurface.
struct SurfaceGuess {
  LooseTriangles loose;
  double cell_mm = 0;   ///< the edge of the smallest cells that it was found on
  bool turned = false;  ///< the triangles face inwards
};

/// What was done to make triangles bound a solid.
struct SolidReport {
  MeshRepairs repairs;
  std::vector<SurfaceGuess> guesses;
  bool is_guess = false;  ///< all of the mesh is
};

/// A mesh that bounds a solid: every side of a triangle is met by one in the opposite direction.
///
/// The source of a triangle is the triangle of the input that it is or, in a guessed surface, that
/// it follows. Triangles that fill holes or span gaps of a guess have none. Triangles that were
/// welded or turned keep theirs; `sourceOfPiece` is that of the pieces in `walls`.
struct SolidMesh : DerivedMesh {
  SwallowedWalls walls{};  ///< the triangles that are not surface of the solid
  SolidReport report{};

  [[nodiscard]] std::uint32_t sourceOfPiece(std::size_t piece) const {
    return source[walls.piece_of[piece]];
  }
};

struct SolidOptions {
  /// Replaces loose triangles by a guess at the solid that they hint at, and refuses triangles that
  /// bound no volume. Otherwise the borders of both are filled like those of other meshes.
  bool guess = true;
  bool find_walls = true;
  /// Called before a guess is made, which takes long; throws to refuse it.
  std::function<void(const LooseTriangles&)> before_guess{};
  std::function<void(double)> progress{};  ///< of a guess, 0 … 1
};

/// Makes any triangles, in mm, bound a solid: by repair, or where they enclose nothing by a guess.
/// Throws DataError where a guess finds no solid, or where the fillings of holes bound the solid
/// rather than the triangles; see Enclosure. The mesh is empty where all triangles are
/// degenerate or cancel. Deterministic.
SolidMesh solidMesh(Mesh triangles, const SolidOptions& options = {});

/// Bodies that are printed as one.
struct SolidBodies {
  SolidMesh whole;                ///< of all triangles together
  std::vector<SolidMesh> bodies;  ///< each by itself; empty where there is one
};

/// The same for several meshes. Sources count through the triangles of all of them. Guesses stand
/// beside what the repair of the others made.
SolidBodies solidBodies(std::vector<Mesh> bodies, const SolidOptions& options = {});

}  // namespace vdbdither
