#include "ops/kernels/mesh/mesh_parts.h"

#include <cstddef>
#include <cstdint>
#include <set>
#include <string>
#include <utility>

#include "ops/kernels/mesh/mesh_edges.h"

namespace vdbdither {

namespace {

/// Whether an opposite side meets every side. Files have a vertex several times where its normal or
/// its place on a texture changes.
bool isClosed(const Mesh& part) {
  const std::vector<std::uint32_t> first = firstAtPlace(part);
  Mesh welded;
  welded.vertices = part.vertices;
  for (const Mesh::Triangle& t : part.triangles) {
    const Mesh::Triangle corners{first[t[0]], first[t[1]], first[t[2]]};
    if (!isDegenerate(corners)) welded.triangles.push_back(corners);
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
