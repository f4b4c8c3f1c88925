#include "ops/kernels/mesh/mesh_parts.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <set>
#include <string>
#include <utility>

#include "ops/kernels/mesh/mesh_edges.h"

namespace vdbdither {

std::vector<Mesh> partsOf(Mesh mesh) {
  constexpr auto none = std::numeric_limits<std::uint32_t>::max();
  std::set<std::string> names;
  std::vector<Mesh> parts;
  std::vector<std::uint32_t> renamed(mesh.vertices.size());
  for (std::size_t i = 0; i < mesh.parts.size(); ++i) {
    names.insert(mesh.parts[i].name);
    Mesh& part = parts.emplace_back();
    std::fill(renamed.begin(), renamed.end(), none);
    const std::size_t end =
        i + 1 < mesh.parts.size() ? mesh.parts[i + 1].begin : mesh.triangles.size();
    for (std::size_t t = mesh.parts[i].begin; t < end; ++t) {
      Mesh::Triangle& triangle = part.triangles.emplace_back(mesh.triangles[t]);
      for (std::uint32_t& corner : triangle) {
        std::uint32_t& vertex = renamed[corner];
        if (vertex == none) {
          vertex = static_cast<std::uint32_t>(part.vertices.size());
          part.vertices.push_back(mesh.vertices[corner]);
        }
        corner = vertex;
      }
    }
    if (names.size() <= i || !isBalanced(part)) {
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
