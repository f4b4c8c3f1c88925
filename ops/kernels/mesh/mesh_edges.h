#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "vdbdither/model/mesh.h"

namespace vdbdither {

/// The edges of a mesh and the sides of triangles on them. Half-edge h is the side of triangle h /
/// 3 that starts at its corner h % 3. Sides from a vertex to itself are left out.
class MeshEdges {
 public:
  struct Edge {
    std::uint32_t from = 0, to = 0;  ///< from < to
    std::uint32_t first = 0;         ///< of its half-edges, in halves_
  };

  explicit MeshEdges(const Mesh& mesh) : MeshEdges(mesh, mesh.triangles.size()) {}
  /// Uses only the first `triangles` triangles.
  MeshEdges(const Mesh& mesh, std::size_t triangles);

  [[nodiscard]] std::uint32_t size() const { return static_cast<std::uint32_t>(edges_.size() - 1); }
  [[nodiscard]] const Edge& operator[](std::uint32_t edge) const { return edges_[edge]; }
  /// The half-edges of an edge, in rising order.
  [[nodiscard]] std::span<const std::uint32_t> halves(std::uint32_t edge) const {
    return {halves_.data() + edges_[edge].first, edges_[edge + 1].first - edges_[edge].first};
  }
  /// How many more sides of triangles of `mesh` go along an edge than against it.
  [[nodiscard]] int surplus(const Mesh& mesh, std::uint32_t edge) const;
  [[nodiscard]] double memoryBytes() const {
    return static_cast<double>(edges_.capacity() * sizeof(Edge) +
                               halves_.capacity() * sizeof(std::uint32_t));
  }

 private:
  std::vector<Edge> edges_;  ///< sorted by `from`, then `to`; one more entry ends the last edge
  std::vector<std::uint32_t> halves_;
};

/// Whether an opposite side meets every side of the triangles.
bool isBalanced(const Mesh& mesh);

/// Returns, for each vertex, the first one at the same place. Zeros of both signs are equal.
std::vector<std::uint32_t> firstAtPlace(const Mesh& mesh);

/// Whether two corners are one vertex.
inline bool isDegenerate(const Mesh::Triangle& t) {
  return t[0] == t[1] || t[1] == t[2] || t[2] == t[0];
}

}  // namespace vdbdither
