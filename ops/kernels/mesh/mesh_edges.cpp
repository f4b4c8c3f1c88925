#include "ops/kernels/mesh/mesh_edges.h"

#include <algorithm>
#include <numeric>
#include <tuple>
#include <utility>

namespace vdbdither {

namespace {

/// Sorts in place; most vertices have only a few edges.
void sortFew(std::uint64_t* begin, std::uint64_t* end) {
  constexpr std::ptrdiff_t few = 24;
  if (end - begin > few) return std::sort(begin, end);
  for (std::uint64_t* it = begin; it < end; ++it) {
    const std::uint64_t value = *it;
    std::uint64_t* to = it;
    for (; to > begin && to[-1] > value; --to) *to = to[-1];
    *to = value;
  }
}

}  // namespace

MeshEdges::MeshEdges(const Mesh& mesh, std::size_t triangles) {
  // For each vertex that is the lower end of a side: the other end and the half-edge, packed to be
  // sorted by both.
  const std::span some(mesh.triangles.data(), triangles);
  const auto forEachSide = [&some](const auto& work) {
    std::uint64_t half = 0;
    for (const Mesh::Triangle& t : some)
      for (std::size_t side = 0; side < 3; ++side, ++half) {
        const auto [from, to] = std::minmax(t[side], t[side < 2 ? side + 1 : 0]);
        if (from != to) work(from, std::uint64_t{to} << 32 | half);
      }
  };
  std::vector<std::uint32_t> first(mesh.vertices.size() + 1, 0);
  forEachSide([&](std::uint32_t from, std::uint64_t) { ++first[from + 1]; });
  for (std::size_t v = 0; v < mesh.vertices.size(); ++v) first[v + 1] += first[v];
  std::vector<std::uint64_t> sides(first.back());
  std::vector<std::uint32_t> next(first.begin(), first.end() - 1);
  forEachSide([&](std::uint32_t from, std::uint64_t side) { sides[next[from]++] = side; });
  halves_.reserve(sides.size());
  edges_.reserve(sides.size() / 2 + 1);
  for (std::uint32_t from = 0; from < mesh.vertices.size(); ++from) {
    sortFew(sides.data() + first[from], sides.data() + first[from + 1]);
    for (std::uint32_t i = first[from]; i < first[from + 1]; ++i) {
      const auto to = static_cast<std::uint32_t>(sides[i] >> 32);
      if (i == first[from] || to != sides[i - 1] >> 32)
        edges_.push_back({from, to, static_cast<std::uint32_t>(halves_.size())});
      halves_.push_back(static_cast<std::uint32_t>(sides[i]));
    }
  }
  edges_.push_back({0, 0, static_cast<std::uint32_t>(halves_.size())});
}

int MeshEdges::surplus(const Mesh& mesh, std::uint32_t edge) const {
  int surplus = 0;
  for (const std::uint32_t half : halves(edge))
    surplus += mesh.triangles[half / 3][half % 3] == edges_[edge].from ? 1 : -1;
  return surplus;
}

bool isBalanced(const Mesh& mesh) {
  const MeshEdges edges(mesh);
  for (std::uint32_t e = 0; e < edges.size(); ++e)
    if (edges.surplus(mesh, e) != 0) return false;
  return true;
}

std::vector<std::uint32_t> firstAtPlace(const Mesh& mesh) {
  std::vector<std::uint32_t> order(mesh.vertices.size());
  std::iota(order.begin(), order.end(), 0U);
  const auto key = [&](std::uint32_t v) {
    const openvdb::Vec3d p = mesh.vertices[v] + openvdb::Vec3d(0, 0, 0);  // −0 becomes +0
    return std::tuple(p.x(), p.y(), p.z());
  };
  std::sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
    return std::pair(key(a), a) < std::pair(key(b), b);
  });
  std::vector<std::uint32_t> first(order.size());
  for (std::size_t i = 0; i < order.size(); ++i)
    first[order[i]] = i > 0 && key(order[i]) == key(order[i - 1]) ? first[order[i - 1]] : order[i];
  return first;
}

}  // namespace vdbdither
