// Marching tetrahedra: Doi, Koide: "An Efficient Method of Triangulating Equi-Valued Surfaces by
// Using Tetrahedral Cells", IEICE Transactions E74(1), 1991.

#include "ops/kernels/measure/surface_area.h"

#include <array>
#include <cmath>
#include <functional>

#include <tbb/blocked_range.h>
#include <tbb/parallel_reduce.h>

namespace vdbdither {

using openvdb::Coord;
using openvdb::FloatGrid;
using openvdb::Vec3d;

namespace {

using Leaf = openvdb::FloatTree::LeafNodeType;

/// Corner n of a cell is offset from the lowest one by the bits of n along x, y and z.
Coord corner(int n) { return {n & 1, n >> 1 & 1, n >> 2 & 1}; }

/// The tetrahedra of a cell, which share the diagonal from corner 0 to corner 7.
constexpr std::array<std::array<int, 4>, 6> tetrahedra{
    {{0, 1, 3, 7}, {0, 3, 2, 7}, {0, 2, 6, 7}, {0, 6, 4, 7}, {0, 4, 5, 7}, {0, 5, 1, 7}}};

double triangleArea(const Vec3d& a, const Vec3d& b, const Vec3d& c) {
  return 0.5 * (b - a).cross(c - a).length();
}

/// Returns the area, within a tetrahedron, of the surface between the negative corners and the
/// others.
double areaWithin(const std::array<int, 4>& tetrahedron, const std::array<float, 8>& distances,
                  const Vec3d& pitch_mm) {
  std::array<int, 4> inside{};
  std::array<int, 4> outside{};
  int inside_count = 0;
  int outside_count = 0;
  for (const int n : tetrahedron) {
    if (distances[n] < 0) {
      inside[inside_count++] = n;
    } else {
      outside[outside_count++] = n;
    }
  }
  const auto crossing = [&](int from, int to) {
    const double share = distances[from] / (double{distances[from]} - distances[to]);
    const Vec3d begin = corner(from).asVec3d() * pitch_mm;
    return begin + (corner(to).asVec3d() * pitch_mm - begin) * share;
  };
  if (inside_count == 2) {
    const Vec3d a = crossing(inside[0], outside[0]);
    const Vec3d c = crossing(inside[1], outside[1]);
    return triangleArea(a, crossing(inside[0], outside[1]), c) +
           triangleArea(a, c, crossing(inside[1], outside[0]));
  }
  if (inside_count == 0 || outside_count == 0) return 0;
  const std::array<int, 4>& many = inside_count == 3 ? inside : outside;
  const int one = inside_count == 3 ? outside[0] : inside[0];
  return triangleArea(crossing(one, many[0]), crossing(one, many[1]), crossing(one, many[2]));
}

}  // namespace

double surfaceArea(const FloatGrid& lower, const FloatGrid& upper, ZRange layers,
                   const Vec3d& pitch_mm) {
  std::vector<const Leaf*> leaves;
  lower.tree().getNodes(leaves);
  const auto diagonal_mm = static_cast<float>(pitch_mm.length());
  return tbb::parallel_reduce(
      tbb::blocked_range<std::size_t>(0, leaves.size(), 32), 0.0,
      [&](const tbb::blocked_range<std::size_t>& range, double sum) {
        const auto below = lower.getConstAccessor();
        const auto above = upper.getConstAccessor();
        for (std::size_t i = range.begin(); i < range.end(); ++i) {
          double area = 0;
          for (auto voxel = leaves[i]->cbeginValueOn(); voxel; ++voxel) {
            const Coord at = voxel.getCoord();
            if (!layers.contains(at.z()) || std::abs(*voxel) > diagonal_mm) continue;
            std::array<float, 8> distances{};
            int negative = 0;
            for (int n = 0; n < 8; ++n) {
              const Coord place = at + corner(n);
              distances[n] = place.z() < layers.end ? below.getValue(place) : above.getValue(place);
              negative += distances[n] < 0;
            }
            if (negative == 0 || negative == 8) continue;
            for (const auto& tetrahedron : tetrahedra)
              area += areaWithin(tetrahedron, distances, pitch_mm);
          }
          sum += std::round(area * 0x1p24) * 0x1p-24;
        }
        return sum;
      },
      std::plus<>());
}

}  // namespace vdbdither
