// Taubin: "A Signal Processing Approach to Fair Surface Design", SIGGRAPH 1995.

#include "ops/kernels/mesh/taubin.h"

#include <cstddef>
#include <cstdint>
#include <vector>

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

namespace vdbdither {

using openvdb::Vec3d;

namespace {

/// The neighbours of every vertex, in the order of the triangles.
struct Neighbours {
  std::vector<std::uint32_t> first;  ///< by vertex; one more entry ends the last
  std::vector<std::uint32_t> vertices;

  explicit Neighbours(const Mesh& mesh)
      : first(mesh.vertices.size() + 1, 0), vertices(3 * mesh.triangles.size()) {
    // On a closed mesh every neighbour is the end of exactly one side that begins here.
    for (const Mesh::Triangle& t : mesh.triangles) {
      for (const std::uint32_t from : t) ++first[from + 1];
    }
    for (std::size_t v = 0; v < mesh.vertices.size(); ++v) first[v + 1] += first[v];
    std::vector<std::uint32_t> next(first.begin(), first.end() - 1);
    for (const Mesh::Triangle& t : mesh.triangles) {
      for (std::size_t side = 0; side < 3; ++side) vertices[next[t[side]]++] = t[(side + 1) % 3];
    }
  }
};

void move(const std::vector<Vec3d>& from, std::vector<Vec3d>& to, const Neighbours& neighbours,
          double share) {
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, from.size(), 4096), [&](const auto& range) {
    for (std::size_t v = range.begin(); v != range.end(); ++v) {
      const std::uint32_t begin = neighbours.first[v];
      const std::uint32_t end = neighbours.first[v + 1];
      Vec3d sum(0.0);
      for (std::uint32_t n = begin; n != end; ++n) sum += from[neighbours.vertices[n]];
      to[v] = from[v];
      if (begin != end) to[v] += (sum / static_cast<double>(end - begin) - from[v]) * share;
    }
  });
}

}  // namespace

void smooth(Mesh& mesh, const Taubin& taubin, const std::function<void(double)>& progress) {
  const Neighbours neighbours(mesh);
  std::vector<Vec3d> other(mesh.vertices.size());
  for (int n = 0; n < taubin.iterations; ++n) {
    move(mesh.vertices, other, neighbours, taubin.lambda);
    move(other, mesh.vertices, neighbours, taubin.mu);
    if (progress) progress((n + 1.0) / taubin.iterations);
  }
}

}  // namespace vdbdither
