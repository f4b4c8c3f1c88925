#include "ops/kernels/mesh/mesh_bodies.h"

#include <algorithm>
#include <span>
#include <utility>

#include "ops/kernels/leaf/disjoint_sets.h"
#include "ops/kernels/mesh/winding_number.h"

namespace vdbdither {

using openvdb::Vec3d;

MeshBodies::MeshBodies(const Mesh& mesh, const MeshEdges& edges) : of_(mesh.triangles.size()) {
  const auto triangles = static_cast<std::uint32_t>(of_.size());
  DisjointSets bodies(triangles);
  const auto joinAll = [&](std::span<const std::uint32_t> halves) {
    for (const std::uint32_t half : halves) bodies.join(halves[0] / 3, half / 3);
  };
  for (std::uint32_t e = 0; e < edges.size(); ++e)
    if (edges.halves(e).size() <= 2) joinAll(edges.halves(e));
  // Those that are open at an edge are closed together, there and, since the others are closed, at
  // all edges of more triangles that have been looked at before.
  std::vector<std::uint32_t> open;
  std::vector<std::pair<std::uint32_t, std::uint32_t>> by_body;  // of half-edges
  for (std::uint32_t e = 0; e < edges.size(); ++e) {
    if (edges.halves(e).size() <= 2) continue;
    by_body.clear();
    for (const std::uint32_t half : edges.halves(e))
      by_body.emplace_back(bodies.find(half / 3), half);
    std::sort(by_body.begin(), by_body.end());
    open.clear();
    for (auto own = by_body.begin(); own != by_body.end();) {
      const auto [body, first] = *own;
      int surplus = 0;
      for (; own != by_body.end() && own->first == body; ++own) {
        const bool is_along = mesh.triangles[own->second / 3][own->second % 3] == edges[e].from;
        surplus += is_along ? 1 : -1;
      }
      if (surplus != 0) open.push_back(first);
    }
    joinAll(open);
  }
  for (std::uint32_t t = 0; t < triangles; ++t) {
    const std::uint32_t first = bodies.find(t);
    of_[t] = first == t ? count_++ : of_[first];
  }
}

std::vector<int> MeshBodies::lowestNumbers(const Mesh& mesh, const MeshEdges& edges,
                                           const std::vector<char>& crosses_itself) const {
  std::vector<char> is_plain(count_, 1);
  std::vector<std::uint32_t> own;
  for (std::uint32_t e = 0; e < edges.size(); ++e) {
    own.clear();
    for (const std::uint32_t half : edges.halves(e)) own.push_back(of_[half / 3]);
    std::sort(own.begin(), own.end());
    for (auto first = own.begin(); first != own.end();) {
      const auto end = std::upper_bound(first, own.end(), *first);
      if (end - first != 2) is_plain[*first] = 0;
      first = end;
    }
  }
  // Six times the volume, from the first corner of each body.
  std::vector<double> volume(count_, 0);
  std::vector<Vec3d> from;
  from.reserve(count_);
  for (std::uint32_t t = 0; t < of_.size(); ++t) {
    const auto [a, b, c] = cornersOf(mesh, t);
    if (of_[t] == from.size()) from.push_back(a);
    const Vec3d& origin = from[of_[t]];
    volume[of_[t]] += (a - origin).dot((b - origin).cross(c - origin));
  }
  std::vector<int> lowest(count_);
  for (std::uint32_t body = 0; body < count_; ++body) {
    const bool is_known = is_plain[body] != 0 && crosses_itself[body] == 0 && volume[body] != 0;
    lowest[body] = !is_known ? any_number : volume[body] > 0 ? 0 : -1;
  }
  return lowest;
}

}  // namespace vdbdither
