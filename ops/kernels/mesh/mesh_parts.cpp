#include "ops/kernels/mesh/mesh_parts.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <numeric>
#include <set>
#include <string>
#include <utility>

#include "ops/kernels/mesh/mesh_edges.h"

namespace vdbdither {

namespace {

/// Whether an opposite side meets every side. Files have a vertex several times where its normal or
/// its place on a texture changes.
bool isClosed(const Mesh& part) {
  const auto& vertices = part.vertices;
  std::vector<std::uint32_t> order(vertices.size());
  std::iota(order.begin(), order.end(), 0U);
  std::sort(order.begin(), order.end(),
            [&](std::uint32_t a, std::uint32_t b) { return vertices[a] < vertices[b]; });
  std::vector<std::uint32_t> first(vertices.size());
  for (std::size_t i = 0; i < order.size(); ++i) {
    const bool is_same = i > 0 && vertices[order[i]] == vertices[order[i - 1]];
    first[order[i]] = is_same ? first[order[i - 1]] : order[i];
  }
  Mesh welded;
  welded.vertices = vertices;
  for (const Mesh::Triangle& triangle : part.triangles) {
    const Mesh::Triangle corners{first[triangle[0]], first[triangle[1]], first[triangle[2]]};
    if (corners[0] == corners[1] || corners[1] == corners[2] || corners[2] == corners[0]) continue;
    welded.triangles.push_back(corners);
  }
  return isBalanced(welded);
}

}  // namespace

std::vector<Mesh> partsOf(Mesh mesh) {
  std::set<std::string> names;
  std::vector<Mesh> parts;
  // By vertex: its name in the last part that has it, and which part that is.
  std::vector<std::uint32_t> renamed(mesh.vertices.size());
  std::vector<std::size_t> last_part(mesh.vertices.size(), mesh.parts.size());
  for (std::size_t i = 0; i < mesh.parts.size(); ++i) {
    names.insert(mesh.parts[i].name);
    Mesh& part = parts.emplace_back();
    const std::size_t end =
        i + 1 < mesh.parts.size() ? mesh.parts[i + 1].begin : mesh.triangles.size();
    for (std::size_t t = mesh.parts[i].begin; t < end; ++t) {
      Mesh::Triangle& triangle = part.triangles.emplace_back(mesh.triangles[t]);
      for (std::uint32_t& corner : triangle) {
        if (std::exchange(last_part[corner], i) != i) {
          renamed[corner] = static_cast<std::uint32_t>(part.vertices.size());
          part.vertices.push_back(mesh.vertices[corner]);
        }
        corner = renamed[corner];
      }
    }
    if (names.size() <= i || !isClosed(part)) {
      parts.clear();
      break;
    }
  }
  if (parts.size() > 1) return parts;
  mesh.parts.clear();
  parts.clear();
  parts.push_back(std::move(mesh));
  return parts;
}

}  // namespace vdbdither
