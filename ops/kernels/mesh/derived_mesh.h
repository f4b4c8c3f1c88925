#pragma once

#include <cstdint>
#include <vector>

#include "vdbdither/model/mesh.h"

namespace vdbdither {

/// The source of a triangle that was made from no other.
inline constexpr std::uint32_t no_source = ~std::uint32_t{0};

/// A mesh made from another, with the triangle of the other that each of its triangles comes from.
struct DerivedMesh {
  Mesh mesh;
  std::vector<std::uint32_t> source;  ///< by triangle: an index in the other mesh, or no_source
};

/// `mesh` as it is: every triangle comes from itself. `first` is the index of the first triangle.
DerivedMesh derived(Mesh mesh, std::uint32_t first = 0);

/// Meshes derived from the same mesh in one, one after the other.
DerivedMesh joined(std::vector<DerivedMesh> meshes);

/// Removes the triangles for which `is_dropped(index)` is true; the others keep their order.
template <class IsDropped>
void dropTriangles(DerivedMesh& derived, const IsDropped& is_dropped) {
  std::uint32_t kept = 0;
  for (std::uint32_t i = 0; i < derived.mesh.triangles.size(); ++i) {
    if (is_dropped(i)) continue;
    derived.mesh.triangles[kept] = derived.mesh.triangles[i];
    derived.source[kept++] = derived.source[i];
  }
  derived.mesh.triangles.resize(kept);
  derived.source.resize(kept);
}

}  // namespace vdbdither
