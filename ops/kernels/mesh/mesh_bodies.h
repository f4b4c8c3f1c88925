#pragma once

#include <cstdint>
#include <limits>
#include <vector>

#include "ops/kernels/mesh/mesh_edges.h"
#include "vdbdither/model/mesh.h"

namespace vdbdither {

/// The bodies of a closed mesh. Each body is closed. Triangles that meet, two alone, at an edge
/// belong to one body; what meets at an edge of more triangles does so only where it is not closed
/// by itself.
class MeshBodies {
 public:
  MeshBodies(const Mesh& mesh, const MeshEdges& edges);

  [[nodiscard]] std::uint32_t count() const { return count_; }
  /// The body of a triangle. Bodies are in the order of their first triangles.
  [[nodiscard]] std::uint32_t of(std::uint32_t triangle) const { return of_[triangle]; }

  /// A body for which `lowest` is not known.
  static constexpr int any_number = std::numeric_limits<int>::min();

  /// Returns for each body the lesser of the two winding numbers that it has: 0 where it faces
  /// outwards, −1 where it faces inwards, and `any_number` where it may have others.
  ///
  /// \param crosses_itself  for each body, whether triangles of it may intersect each other
  [[nodiscard]] std::vector<int> lowestNumbers(const Mesh& mesh, const MeshEdges& edges,
                                               const std::vector<char>& crosses_itself) const;

 private:
  std::vector<std::uint32_t> of_;
  std::uint32_t count_ = 0;
};

}  // namespace vdbdither
