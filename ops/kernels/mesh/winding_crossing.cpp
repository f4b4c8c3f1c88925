#include "ops/kernels/mesh/winding_crossing.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include <openvdb/math/Mat3.h>

#include "ops/kernels/mesh/winding_number.h"
#include "vdbdither/model/openvdb.h"

namespace vdbdither {

using openvdb::Vec3d;

namespace {

/// The thinnest wall or gap that is kept, of the mesh's longest side.
constexpr double thinnest_wall = 4e-4;
/// How far from a triangle its sides are judged, in edges.
constexpr double beside = 1e-5;
/// Crossings and vertices keep this distance from corners and faces, in edges, so that no two of
/// them coincide.
constexpr double clearance = 1.0 / 1024;

/// Where an edge pierces a triangle.
struct Pierced {
  double t;  ///< along the edge, 0 … 1
  Vec3d normal;
  std::uint32_t triangle;

  bool operator<(const Pierced& other) const { return t < other.t; }
};

/// Where the sides of a triangle differ, or the ends of a stretch between triangles do.
struct Pass {
  double low, high;  ///< equal at a triangle
  Vec3d normal{0.0};
  std::uint32_t triangle = no_source;
};

std::vector<Pierced> piercedBy(const Mesh& mesh, const LeafEdge& edge) {
  const int u = (edge.axis + 1) % 3;
  const int v = (edge.axis + 2) % 3;
  const Vec3d& from = edge.from;
  std::vector<Pierced> pierced;
  for (const std::uint32_t triangle : edge.triangles) {
    const std::array<Vec3d, 3> at = cornersOf(mesh, triangle);
    const Vec3d normal = (at[1] - at[0]).cross(at[2] - at[0]);
    if (normal[edge.axis] == 0) continue;
    int left = 0;
    for (std::size_t side = 0; side < 3; ++side) {
      const Vec3d& a = at[side];
      const Vec3d& b = at[(side + 1) % 3];
      left += (b[u] - a[u]) * (from[v] - a[v]) - (b[v] - a[v]) * (from[u] - a[u]) >= 0 ? 1 : 0;
    }
    if (left != (normal[edge.axis] > 0 ? 3 : 0)) continue;
    const double t = normal.dot(at[0] - from) / (normal[edge.axis] * edge.size_mm);
    if (t > beside && t < 1 - beside) pierced.push_back({t, normal / normal.length(), triangle});
  }
  std::stable_sort(pierced.begin(), pierced.end());
  return pierced;
}

/// \param looks  counts the places where the number is found
std::vector<Pass> passesOf(const WindingSolid& solid, const LeafEdge& edge, const Vec3d& along,
                           std::uint32_t& looks) {
  std::vector<Pass> passes;
  const auto add = [&](const Pass& next) {
    // Two that are so near enclose no wall and no gap.
    const bool is_sliver =
        !passes.empty() &&
        0.5 * (next.low + next.high - passes.back().low - passes.back().high) * edge.size_mm <
            thinnest_wall * solid.cells().longestMm();
    if (is_sliver) {
      passes.pop_back();
    } else {
      passes.push_back(next);
    }
  };
  double low = 0;
  bool last = edge.low_is_inside;
  for (const Pierced& pierced : piercedBy(solid.cells().mesh(), edge)) {
    const double t = pierced.t;
    ++looks;
    // Across a triangle the number jumps by one.
    const double number = solid.judgedAt(edge.cell, edge.from + along * (t - beside));
    const bool before = number > 0.5;
    const bool after =
        number - (pierced.normal[edge.axis] > 0 ? solid.side() : -solid.side()) > 0.5;
    if (before != last) add({low, t - beside});
    if (before != after) add({t, t, pierced.normal, pierced.triangle});
    low = t + beside;
    last = after;
  }
  if (last != edge.high_is_inside) add({low, 1});
  return passes;
}

/// Where the number passes ½ on a stretch that no triangle cuts: regula falsi, which halves the
/// weight of an end that stays (Illinois).
double smoothCrossing(const WindingSolid& solid, const LeafEdge& edge, const Vec3d& along,
                      double low, double high, std::uint32_t& looks) {
  const auto above = [&](double t) {
    ++looks;
    return solid.numberAt(edge.cell, edge.from + along * t) - 0.5;
  };
  double at_low = above(low);
  double at_high = above(high);
  int kept = 0;
  for (int step = 0; step < 20 && high - low > 1e-3; ++step) {
    // The ends were judged by the exact number.
    if ((at_low > 0) == (at_high > 0)) return std::abs(at_low) < std::abs(at_high) ? low : high;
    const double t = low + (high - low) * at_low / (at_low - at_high);
    const double at_t = above(t);
    if (std::abs(at_t) < 1e-5) return t;
    if ((at_t > 0) == (at_low > 0)) {
      low = t;
      at_low = at_t;
      if (kept == 1) at_high *= 0.5;
      kept = 1;
    } else {
      high = t;
      at_high = at_t;
      if (kept == -1) at_low *= 0.5;
      kept = -1;
    }
  }
  return 0.5 * (low + high);
}

}  // namespace

Vec3d LeafCube::within(Vec3d p) const {
  for (int axis = 0; axis < 3; ++axis)
    p[axis] =
        std::clamp(p[axis], low[axis] + clearance * size_mm, low[axis] + (1 - clearance) * size_mm);
  return p;
}

EdgeCrossing crossingOf(const WindingSolid& solid, const LeafEdge& edge) {
  Vec3d along(0.0);
  along[edge.axis] = edge.size_mm;
  EdgeCrossing crossing;
  const std::vector<Pass> passes = passesOf(solid, edge, along, crossing.looks);
  if (passes.empty()) return crossing;
  crossing.passes = static_cast<std::uint8_t>(std::min<std::size_t>(passes.size(), 2));
  const Pass& first = passes.front();
  crossing.triangle = first.triangle;
  crossing.is_smooth = first.high > first.low;
  const double t = crossing.is_smooth
                       ? smoothCrossing(solid, edge, along, first.low, first.high, crossing.looks)
                       : first.low;
  crossing.at = edge.from + along * std::clamp(t, clearance, 1 - clearance);
  crossing.normal = crossing.is_smooth
                        ? solid.cells().gradientAt(edge.cell, edge.from + along * t).unitSafe()
                        : first.normal;
  return crossing;
}

Vec3d meetingPoint(const LeafCube& cube, std::span<const EdgeCrossing> crossings) {
  Vec3d middle(0.0);
  for (const EdgeCrossing& crossing : crossings) middle += crossing.at;
  middle /= static_cast<double>(crossings.size());
  openvdb::Mat3d sum = openvdb::Mat3d::zero();
  Vec3d pull(0.0);
  for (const EdgeCrossing& crossing : crossings) {
    const Vec3d& n = crossing.normal;
    const double height = n.dot(crossing.at - middle);
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) sum(i, j) += n[i] * n[j];
    pull += n * height;
  }
  openvdb::Mat3d directions;
  Vec3d strengths;
  if (!openvdb::math::diagonalizeSymmetricMatrix(sum, directions, strengths)) return middle;
  Vec3d at = middle;
  for (int i = 0; i < 3; ++i) {
    const Vec3d direction(directions(0, i), directions(1, i), directions(2, i));
    if (strengths[i] > 0.05 * static_cast<double>(crossings.size()))
      at += direction * (direction.dot(pull) / strengths[i]);
  }
  return cube.within(at);
}

}  // namespace vdbdither
