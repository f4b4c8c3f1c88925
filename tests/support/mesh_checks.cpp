#include "tests/support/mesh_checks.h"

#include <algorithm>
#include <map>
#include <utility>
#include <vector>

namespace vdbdither::test {

std::string firstFlaw(const Mesh& mesh) {
  std::map<std::pair<std::uint32_t, std::uint32_t>, int> sides;
  std::vector<std::map<std::uint32_t, std::uint32_t>> rings(mesh.vertices.size());
  for (const Mesh::Triangle& t : mesh.triangles) {
    for (std::size_t side = 0; side < 3; ++side) {
      const std::uint32_t from = t[side];
      const std::uint32_t to = t[(side + 1) % 3];
      if (from == to) return "a triangle has a corner twice";
      if (++sides[{from, to}] > 1) return "two triangles have a side in the same direction";
      rings[from][to] = t[(side + 2) % 3];
    }
  }
  for (const auto& [side, count] : sides) {
    if (!sides.contains({side.second, side.first})) return "a side is met by no other";
  }
  for (const auto& ring : rings) {
    if (ring.empty()) return "a vertex has no triangle";
    std::size_t met = 0;
    std::uint32_t at = ring.begin()->first;
    do {
      at = ring.at(at);
      ++met;
    } while (at != ring.begin()->first);
    if (met != ring.size()) return "the triangles at a vertex form more than one ring";
  }
  return "";
}

std::size_t openSides(const Mesh& mesh) {
  std::map<std::pair<std::uint32_t, std::uint32_t>, int> surplus;
  for (const Mesh::Triangle& t : mesh.triangles)
    for (std::size_t side = 0; side < 3; ++side) {
      const std::uint32_t a = t[side];
      const std::uint32_t b = t[(side + 1) % 3];
      surplus[std::minmax(a, b)] += a < b ? 1 : -1;
    }
  std::size_t open = 0;
  for (const auto& [side, count] : surplus) open += count != 0;
  return open;
}

int eulerCharacteristic(const Mesh& mesh) {
  return static_cast<int>(mesh.vertices.size()) - static_cast<int>(mesh.triangles.size()) / 2;
}

double volumeOf(const Mesh& mesh) {
  double sum = 0;
  for (const Mesh::Triangle& t : mesh.triangles)
    sum += mesh.vertices[t[0]].dot(mesh.vertices[t[1]].cross(mesh.vertices[t[2]])) / 6;
  return sum;
}

}  // namespace vdbdither::test
