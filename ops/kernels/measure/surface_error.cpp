#include "ops/kernels/measure/surface_error.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_sort.h>

namespace vdbdither {

using openvdb::Vec3d;

namespace {

constexpr std::size_t steps = 1000;

/// Adds the points that represent a triangle, the centres of n² equal ones.
void addCentres(const std::array<Vec3d, 3>& corners, int n, double area_mm2,
                std::vector<Vec3d>& points, std::vector<double>& weights) {
  const Vec3d u = (corners[1] - corners[0]) / n;
  const Vec3d v = (corners[2] - corners[0]) / n;
  for (int i = 0; i < n; ++i) {
    for (int j = 0; i + j < n; ++j) {
      points.push_back(corners[0] + u * (i + 1 / 3.0) + v * (j + 1 / 3.0));
      if (i + j + 1 < n) points.push_back(corners[0] + u * (i + 2 / 3.0) + v * (j + 2 / 3.0));
    }
  }
  weights.resize(points.size(), area_mm2 / (static_cast<double>(n) * n));
}

ErrorStatistics statistics(std::vector<std::pair<double, double>> sizes_and_weights,
                           double signed_sum) {
  ErrorStatistics result;
  double sum = 0;
  double squares = 0;
  for (const auto& [size, weight] : sizes_and_weights) {
    result.weight += weight;
    sum += weight * size;
    squares += weight * size * size;
    result.maximum_mm = std::max(result.maximum_mm, size);
  }
  result.quantiles_mm.assign(steps + 1, 0);
  if (!(result.weight > 0)) return result;
  result.bias_mm = signed_sum / result.weight;
  result.mean_mm = sum / result.weight;
  result.rms_mm = std::sqrt(squares / result.weight);
  tbb::parallel_sort(sizes_and_weights.begin(), sizes_and_weights.end());
  double below = 0;
  std::size_t next = 0;
  for (const auto& [size, weight] : sizes_and_weights) {
    below += weight;
    for (; next <= steps && static_cast<double>(next) / steps * result.weight <= below; ++next)
      result.quantiles_mm[next] = size;
  }
  for (; next <= steps; ++next) result.quantiles_mm[next] = result.maximum_mm;
  return result;
}

}  // namespace

SurfaceErrors surfaceErrors(const Mesh& surface, const ClosestPoints& reference, double spacing_mm,
                            const std::function<void(double)>& progress) {
  std::vector<Vec3d> points = surface.vertices;
  SurfaceErrors errors;
  errors.vertices = points.size();
  errors.weight_mm2.assign(points.size(), 0.0);
  for (const Mesh::Triangle& t : surface.triangles) {
    const std::array<Vec3d, 3> corners{surface.vertices[t[0]], surface.vertices[t[1]],
                                       surface.vertices[t[2]]};
    const double area_mm2 = 0.5 * (corners[1] - corners[0]).cross(corners[2] - corners[0]).length();
    double longest = 0;
    for (std::size_t side = 0; side < 3; ++side)
      longest = std::max(longest, (corners[(side + 1) % 3] - corners[side]).length());
    if (longest > spacing_mm) {
      const int n = static_cast<int>(std::ceil(longest / spacing_mm));
      addCentres(corners, n, area_mm2, points, errors.weight_mm2);
    } else {
      for (const std::uint32_t vertex : t) errors.weight_mm2[vertex] += area_mm2 / 3;
    }
  }

  errors.error_mm.resize(points.size());
  errors.triangle.resize(points.size());
  errors.nearest.resize(points.size());
  constexpr std::size_t block = std::size_t{1} << 18;
  for (std::size_t begin = 0; begin < points.size(); begin += block) {
    const std::size_t end = std::min(points.size(), begin + block);
    tbb::parallel_for(tbb::blocked_range<std::size_t>(begin, end, 1024), [&](const auto& range) {
      // Consecutive points are mostly near the same triangle.
      std::uint32_t hint = 0;
      for (std::size_t n = range.begin(); n != range.end(); ++n) {
        const ClosestPoint found = reference(points[n], hint);
        errors.error_mm[n] = found.distance_mm;
        errors.triangle[n] = found.triangle;
        errors.nearest[n] = openvdb::Vec3s(found.point);
        hint = found.triangle;
      }
    });
    if (progress) progress(static_cast<double>(end) / static_cast<double>(points.size()));
  }
  return errors;
}

double ErrorStatistics::percentile(double percent) const {
  return quantiles_mm[static_cast<std::size_t>(std::lround(percent / 100 * steps))];
}

ErrorStatistics statisticsByArea(const SurfaceErrors& errors) {
  std::vector<std::pair<double, double>> sizes;
  sizes.reserve(errors.size());
  double sum = 0;
  for (std::size_t n = 0; n < errors.size(); ++n) {
    const double weight = errors.weight_mm2[n];
    if (!(weight > 0)) continue;
    sizes.emplace_back(std::abs(errors.error_mm[n]), weight);
    sum += weight * errors.error_mm[n];
  }
  return statistics(std::move(sizes), sum);
}

ErrorStatistics statisticsByVertex(const SurfaceErrors& errors) {
  std::vector<std::pair<double, double>> sizes;
  sizes.reserve(errors.vertices);
  double sum = 0;
  for (std::size_t n = 0; n < errors.vertices; ++n) {
    sizes.emplace_back(std::abs(errors.error_mm[n]), 1.0);
    sum += errors.error_mm[n];
  }
  return statistics(std::move(sizes), sum);
}

}  // namespace vdbdither
