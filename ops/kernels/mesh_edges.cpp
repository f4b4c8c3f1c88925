#include "ops/kernels/mesh_edges.h"

#include <algorithm>
#include <utility>

namespace vdbdither {

MeshEdges::MeshEdges(const Mesh& mesh) {
  struct Side {
    std::uint32_t to, half;
  };
  const auto ends = [&mesh](std::size_t half) {
    const Mesh::Triangle& t = mesh.triangles[half / 3];
    return std::minmax({t[half % 3], t[(half + 1) % 3]});
  };
  const std::size_t halves = 3 * mesh.triangles.size();
  std::vector<std::uint32_t> first(mesh.vertices.size() + 1, 0);
  for (std::size_t half = 0; half < halves; ++half) {
    const auto [from, to] = ends(half);
    if (from != to) ++first[from + 1];
  }
  for (std::size_t v = 0; v < mesh.vertices.size(); ++v) first[v + 1] += first[v];
  std::vector<Side> sorted(first.back());
  std::vector<std::uint32_t> next(first.begin(), first.end() - 1);
  for (std::size_t half = 0; half < halves; ++half) {
    const auto [from, to] = ends(half);
    if (from != to) sorted[next[from]++] = {to, static_cast<std::uint32_t>(half)};
  }
  halves_.reserve(sorted.size());
  edges_.reserve(sorted.size() / 2 + 1);
  for (std::uint32_t from = 0; from < mesh.vertices.size(); ++from) {
    const auto begin = sorted.begin() + first[from];
    const auto end = sorted.begin() + first[from + 1];
    std::sort(begin, end, [](const Side& a, const Side& b) {
      return std::pair(a.to, a.half) < std::pair(b.to, b.half);
    });
    for (auto it = begin; it != end; ++it) {
      if (it == begin || it->to != std::prev(it)->to)
        edges_.push_back({from, it->to, static_cast<std::uint32_t>(halves_.size())});
      halves_.push_back(it->half);
    }
  }
  edges_.push_back({0, 0, static_cast<std::uint32_t>(halves_.size())});
}

}  // namespace vdbdither
