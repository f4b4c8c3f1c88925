// Lorensen, Cline: "Marching Cubes: A High Resolution 3D Surface Construction Algorithm",
// SIGGRAPH 1987.

#include "ops/kernels/contour/marching_cubes.h"

#include <limits>
#include <stdexcept>

namespace vdbdither {

namespace {

constexpr int edge_count = 12;
constexpr double forbidden = 1e9;

using Loop = std::vector<int>;

int bit(int corner, int axis) { return corner >> axis & 1; }

/// Returns the edge between two corners that differ along one axis.
int edgeBetween(int a, int b) {
  const int low = a & b;
  switch (a ^ b) {
    case 1:
      return bit(low, 1) + 2 * bit(low, 2);
    case 2:
      return 4 + bit(low, 0) + 2 * bit(low, 2);
    default:
      return 8 + bit(low, 0) + 2 * bit(low, 1);
  }
}

/// Returns the middle of an edge, in half cells.
std::array<int, 3> middle(int edge) {
  const int axis = edge / 4;
  const int u = axis == 0 ? 1 : 0;
  const int v = axis == 2 ? 1 : 2;
  std::array<int, 3> at{};
  at[static_cast<std::size_t>(axis)] = 1;
  at[static_cast<std::size_t>(u)] = 2 * (edge & 1);
  at[static_cast<std::size_t>(v)] = 2 * (edge >> 1 & 1);
  return at;
}

/// Returns the cost of a diagonal between two edges: its squared length, or a prohibitive value if
/// it lies in a face.
double diagonalCost(int a, int b) {
  const auto p = middle(a);
  const auto q = middle(b);
  double length2 = 0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (p[axis] == q[axis] && p[axis] != 1) return forbidden;
    length2 += (p[axis] - q[axis]) * (p[axis] - q[axis]);
  }
  return length2;
}

/// Cuts the polygon into triangles with the minimum sum of costs of their diagonals.
void triangulate(const Loop& loop, CubeCase& made) {
  const std::size_t n = loop.size();
  std::vector<std::vector<double>> cost(n, std::vector<double>(n, 0));
  std::vector<std::vector<std::size_t>> apex(n, std::vector<std::size_t>(n, 0));
  for (std::size_t length = 2; length < n; ++length) {
    for (std::size_t first = 0; first + length < n; ++first) {
      const std::size_t last = first + length;
      double best = std::numeric_limits<double>::infinity();
      for (std::size_t k = first + 1; k < last; ++k) {
        const double sum = cost[first][k] + cost[k][last];
        if (sum < best) {
          best = sum;
          apex[first][last] = k;
        }
      }
      const bool side = first == 0 && last == n - 1;
      cost[first][last] = best + (side ? 0 : diagonalCost(loop[first], loop[last]));
    }
  }
  if (cost[0][n - 1] >= forbidden) throw std::logic_error("a polygon of a cell has no triangles");
  std::vector<std::pair<std::size_t, std::size_t>> open{{0, n - 1}};
  while (!open.empty()) {
    const auto [first, last] = open.back();
    open.pop_back();
    if (last - first < 2) continue;
    const std::size_t k = apex[first][last];
    made.triangles.push_back({static_cast<std::uint8_t>(loop[first]),
                              static_cast<std::uint8_t>(loop[k]),
                              static_cast<std::uint8_t>(loop[last])});
    open.emplace_back(k, last);
    open.emplace_back(first, k);
  }
}

/// Returns for each edge the next one on the boundary of the surface, face by face.
std::array<int, edge_count> edgesInOrder(int inside) {
  std::array<int, edge_count> next{};
  next.fill(-1);
  for (int axis = 0; axis < 3; ++axis) {
    const int u = 1 << (axis + 1) % 3;
    const int v = 1 << (axis + 2) % 3;
    for (int side = 0; side < 2; ++side) {
      // Counter-clockwise seen from outside the cell.
      const int base = side << axis;
      const std::array<int, 4> corners =
          side == 1 ? std::array<int, 4>{base, base + u, base + u + v, base + v}
                    : std::array<int, 4>{base, base + v, base + u + v, base + u};
      const auto corner = [&](std::size_t i) { return corners[i % 4]; };
      const auto isInside = [&](std::size_t i) { return bit(inside, corner(i)) == 1; };
      for (std::size_t leave = 0; leave < 4; ++leave) {
        if (!isInside(leave) || isInside(leave + 1)) continue;
        // The sequence of outside corners that begins here is cut off on its own.
        std::size_t enter = leave + 1;
        while (!isInside(enter + 1)) ++enter;
        next[static_cast<std::size_t>(edgeBetween(corner(enter), corner(enter + 1)))] =
            edgeBetween(corner(leave), corner(leave + 1));
      }
    }
  }
  return next;
}

CubeCase caseOf(int inside) {
  CubeCase made;
  std::array<int, edge_count> next = edgesInOrder(inside);
  for (int start = 0; start < edge_count; ++start) {
    Loop loop;
    for (int edge = start; next[static_cast<std::size_t>(edge)] >= 0;) {
      loop.push_back(edge);
      made.edges |= static_cast<std::uint16_t>(1U << edge);
      const int following = next[static_cast<std::size_t>(edge)];
      next[static_cast<std::size_t>(edge)] = -1;
      edge = following;
    }
    if (!loop.empty()) triangulate(loop, made);
  }
  return made;
}

}  // namespace

const std::array<CubeCase, 256>& cubeCases() {
  static const std::array<CubeCase, 256> cases = [] {
    std::array<CubeCase, 256> made;
    for (int inside = 0; inside < 256; ++inside)
      made[static_cast<std::size_t>(inside)] = caseOf(inside);
    return made;
  }();
  return cases;
}

}  // namespace vdbdither
