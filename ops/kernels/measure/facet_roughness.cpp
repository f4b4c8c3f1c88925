// Sa and Sq: ISO 25178-2. The Gaussian filter: ISO 16610-61.

#include "ops/kernels/measure/facet_roughness.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include <openvdb/math/Mat3.h>
#include <tbb/parallel_for.h>

#include "ops/kernels/mesh/mesh_edges.h"

namespace vdbdither {

using openvdb::Vec2d;
using openvdb::Vec3d;

namespace {

constexpr auto nothing = std::numeric_limits<std::uint32_t>::max();

Vec3d areaNormal(const Mesh& mesh, std::uint32_t triangle) {
  const Mesh::Triangle& t = mesh.triangles[triangle];
  const Vec3d& a = mesh.vertices[t[0]];
  return (mesh.vertices[t[1]] - a).cross(mesh.vertices[t[2]] - a) * 0.5;
}

/// The edges at which a facet ends, as triangles without area.
Mesh borderOf(const Mesh& mesh, const MeshEdges& edges, const std::vector<std::uint32_t>& facets,
              std::uint32_t facet, std::span<const std::uint32_t> facet_edges) {
  Mesh border;
  for (const std::uint32_t edge : facet_edges) {
    std::size_t own = 0;
    for (const std::uint32_t half : edges.halves(edge)) own += facets[half / 3] == facet;
    if (own == edges.halves(edge).size() && own > 1) continue;
    const auto first = static_cast<std::uint32_t>(border.vertices.size());
    border.vertices.push_back(mesh.vertices[edges[edge].from]);
    border.vertices.push_back(mesh.vertices[edges[edge].to]);
    border.triangles.push_back({first, first + 1, first + 1});
  }
  return border;
}

/// Convolves rows of `size` values, `stride` apart, with a Gaussian.
void filterRows(std::vector<double>& values, int rows, int columns, bool along_columns,
                const std::vector<double>& weights) {
  const int size = along_columns ? rows : columns;
  const int lines = along_columns ? columns : rows;
  const int reach = static_cast<int>(weights.size()) / 2;
  tbb::parallel_for(0, lines, [&](int line) {
    std::vector<double> before(static_cast<std::size_t>(size));
    const auto at = [&](int n) {
      return along_columns ? static_cast<std::size_t>(n) * columns + line
                           : static_cast<std::size_t>(line) * columns + n;
    };
    for (int n = 0; n < size; ++n) before[static_cast<std::size_t>(n)] = values[at(n)];
    for (int n = 0; n < size; ++n) {
      double sum = 0;
      for (int m = std::max(0, n - reach); m <= std::min(size - 1, n + reach); ++m)
        sum +=
            weights[static_cast<std::size_t>(m - n + reach)] * before[static_cast<std::size_t>(m)];
      values[at(n)] = sum;
    }
  });
}

}  // namespace

std::vector<std::uint32_t> facetsOf(const Mesh& mesh) {
  const double minimum_cosine = std::cos(0.01 * std::numbers::pi / 180);
  const MeshEdges edges(mesh);
  std::vector<std::array<std::uint32_t, 3>> edge_of_side(mesh.triangles.size(),
                                                         {nothing, nothing, nothing});
  for (std::uint32_t edge = 0; edge < edges.size(); ++edge) {
    for (const std::uint32_t half : edges.halves(edge)) edge_of_side[half / 3][half % 3] = edge;
  }
  std::vector<std::uint32_t> facets(mesh.triangles.size(), nothing);
  std::uint32_t count = 0;
  std::vector<std::uint32_t> open;
  for (std::uint32_t seed = 0; seed < facets.size(); ++seed) {
    if (facets[seed] != nothing) continue;
    const Vec3d normal = areaNormal(mesh, seed);
    facets[seed] = count;
    open.push_back(seed);
    while (!open.empty()) {
      const std::uint32_t triangle = open.back();
      open.pop_back();
      for (const std::uint32_t edge : edge_of_side[triangle]) {
        if (edge == nothing || edges.halves(edge).size() != 2) continue;
        for (const std::uint32_t half : edges.halves(edge)) {
          const std::uint32_t other = half / 3;
          const Vec3d beside = areaNormal(mesh, other);
          if (facets[other] != nothing ||
              !(normal.dot(beside) > minimum_cosine * normal.length() * beside.length()))
            continue;
          facets[other] = count;
          open.push_back(other);
        }
      }
    }
    ++count;
  }
  return facets;
}

void HeightField::level() {
  // Normal equations about the weighted centre, where they are well-conditioned.
  double weights = 0;
  Vec3d centre(0.0);
  for (std::size_t n = 0; n < weight.size(); ++n) {
    weights += weight[n];
    centre += weight[n] * Vec3d(at_mm[n].x(), at_mm[n].y(), height_mm[n]);
  }
  if (!(weights > 0)) return;
  centre /= weights;
  double xx = 0;
  double xy = 0;
  double yy = 0;
  double xh = 0;
  double yh = 0;
  for (std::size_t n = 0; n < weight.size(); ++n) {
    const double x = at_mm[n].x() - centre.x();
    const double y = at_mm[n].y() - centre.y();
    const double h = height_mm[n] - centre.z();
    xx += weight[n] * x * x;
    xy += weight[n] * x * y;
    yy += weight[n] * y * y;
    xh += weight[n] * x * h;
    yh += weight[n] * y * h;
  }
  const double determinant = xx * yy - xy * xy;
  const bool flat = determinant > 1e-12 * xx * yy;
  const double along_x = flat ? (xh * yy - yh * xy) / determinant : 0;
  const double along_y = flat ? (yh * xx - xh * xy) / determinant : 0;
  for (std::size_t n = 0; n < weight.size(); ++n) {
    height_mm[n] -=
        centre.z() + along_x * (at_mm[n].x() - centre.x()) + along_y * (at_mm[n].y() - centre.y());
  }
}

double HeightField::meanSize() const {
  double sum = 0;
  double weights = 0;
  for (std::size_t n = 0; n < weight.size(); ++n) {
    sum += weight[n] * std::abs(height_mm[n]);
    weights += weight[n];
  }
  return weights > 0 ? sum / weights : 0;
}

double HeightField::rms() const {
  double sum = 0;
  double weights = 0;
  for (std::size_t n = 0; n < weight.size(); ++n) {
    sum += weight[n] * height_mm[n] * height_mm[n];
    weights += weight[n];
  }
  return weights > 0 ? std::sqrt(sum / weights) : 0;
}

double HeightField::rmsBeyond(double cutoff_mm) const {
  if (at_mm.empty()) return 0;
  Vec2d low = at_mm.front();
  Vec2d high = low;
  for (const Vec2d& p : at_mm) {
    low = openvdb::math::minComponent(low, p);
    high = openvdb::math::maxComponent(high, p);
  }
  constexpr int maximum_pixels = 4096;
  const double extent = std::max(high.x() - low.x(), high.y() - low.y());
  const double pixel_mm = std::max(cutoff_mm / 8, extent / maximum_pixels);
  const int columns = static_cast<int>((high.x() - low.x()) / pixel_mm) + 1;
  const int rows = static_cast<int>((high.y() - low.y()) / pixel_mm) + 1;
  const std::size_t size = static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows);
  std::vector<double> heights(size, 0.0);
  std::vector<double> weights(size, 0.0);
  for (std::size_t n = 0; n < at_mm.size(); ++n) {
    const auto column = static_cast<std::size_t>((at_mm[n].x() - low.x()) / pixel_mm);
    const auto row = static_cast<std::size_t>((at_mm[n].y() - low.y()) / pixel_mm);
    heights[row * static_cast<std::size_t>(columns) + column] += weight[n] * height_mm[n];
    weights[row * static_cast<std::size_t>(columns) + column] += weight[n];
  }
  const std::vector<double> measured = weights;
  // exp(−π (x / αλ)²) with α = √(ln 2 / π), over one cut-off to either side.
  std::vector<double> filter;
  const int reach = static_cast<int>(std::ceil(cutoff_mm / pixel_mm));
  for (int n = -reach; n <= reach; ++n) {
    const double x = n * pixel_mm / cutoff_mm;
    filter.push_back(std::exp(-x * x * std::numbers::pi * std::numbers::pi / std::numbers::ln2));
  }
  for (std::vector<double>* values : {&heights, &weights}) {
    filterRows(*values, rows, columns, false, filter);
    filterRows(*values, rows, columns, true, filter);
  }
  double sum = 0;
  double of = 0;
  for (std::size_t n = 0; n < size; ++n) {
    if (!(measured[n] > 0)) continue;
    const double mean = heights[n] / weights[n];
    sum += measured[n] * mean * mean;
    of += measured[n];
  }
  return of > 0 ? std::sqrt(sum / of) : 0;
}

namespace {

/// The facets to measure, largest first, with their areas and (not yet unit) normals.
struct ChosenFacets {
  std::vector<FacetRoughness> facets;
  std::vector<std::uint32_t> numbers;  ///< of the facets, as `facetsOf` counts them
  std::vector<std::uint32_t> place;    ///< by facet number: its place among the chosen, or nothing
};

ChosenFacets chosenFacets(const Mesh& mesh, const std::vector<std::uint32_t>& facet_of,
                          const RoughnessRules& rules) {
  std::vector<FacetRoughness> all;
  for (std::uint32_t t = 0; t < facet_of.size(); ++t) {
    if (facet_of[t] == all.size()) all.push_back({t, Vec3d(0.0)});
    const Vec3d area = areaNormal(mesh, t);
    all[facet_of[t]].normal += area;
    all[facet_of[t]].area_mm2 += area.length();
  }
  ChosenFacets chosen;
  for (std::uint32_t facet = 0; facet < all.size(); ++facet) {
    if (all[facet].area_mm2 >= rules.minimum_area_mm2) chosen.numbers.push_back(facet);
  }
  std::sort(chosen.numbers.begin(), chosen.numbers.end(), [&](std::uint32_t a, std::uint32_t b) {
    return std::pair(-all[a].area_mm2, a) < std::pair(-all[b].area_mm2, b);
  });
  if (chosen.numbers.size() > rules.maximum_facets) chosen.numbers.resize(rules.maximum_facets);
  chosen.place.assign(all.size(), nothing);
  for (std::uint32_t n = 0; n < chosen.numbers.size(); ++n) {
    chosen.place[chosen.numbers[n]] = n;
    chosen.facets.push_back(all[chosen.numbers[n]]);
  }
  return chosen;
}

/// For each chosen facet the edges of its triangles, in rising order.
std::vector<std::vector<std::uint32_t>> edgesByFacet(const MeshEdges& edges,
                                                     const std::vector<std::uint32_t>& facet_of,
                                                     const ChosenFacets& chosen) {
  std::vector<std::vector<std::uint32_t>> result(chosen.facets.size());
  for (std::uint32_t edge = 0; edge < edges.size(); ++edge) {
    for (const std::uint32_t half : edges.halves(edge)) {
      const std::uint32_t n = chosen.place[facet_of[half / 3]];
      if (n != nothing && (result[n].empty() || result[n].back() != edge))
        result[n].push_back(edge);
    }
  }
  return result;
}

/// For each chosen facet the measured points whose nearest triangle belongs to it.
std::vector<std::vector<std::uint32_t>> pointsByFacet(const SurfaceErrors& errors,
                                                      const std::vector<std::uint32_t>& facet_of,
                                                      const ChosenFacets& chosen) {
  std::vector<std::vector<std::uint32_t>> result(chosen.facets.size());
  for (std::size_t n = 0; n < errors.size(); ++n) {
    const std::uint32_t to = chosen.place[facet_of[errors.triangle[n]]];
    if (to != nothing && errors.weight_mm2[n] > 0)
      result[to].push_back(static_cast<std::uint32_t>(n));
  }
  return result;
}

/// Removes the points that are nearer to the border of their facet than `margin_mm`.
void dropNear(const Mesh& border, double margin_mm, const SurfaceErrors& errors,
              std::vector<std::uint32_t>& points) {
  if (border.triangles.empty() || !(margin_mm > 0)) return;
  std::vector<char> within(points.size(), 1);
  const ClosestPoints edge_of_facet(border);
  tbb::parallel_for(
      tbb::blocked_range<std::size_t>(0, points.size(), 1024), [&](const auto& range) {
        std::uint32_t hint = 0;
        for (std::size_t m = range.begin(); m != range.end(); ++m) {
          const ClosestPoint found = edge_of_facet(Vec3d(errors.nearest[points[m]]), hint);
          hint = found.triangle;
          within[m] = std::abs(found.distance_mm) >= margin_mm;
        }
      });
  std::size_t kept = 0;
  for (std::size_t m = 0; m < points.size(); ++m)
    if (within[m]) points[kept++] = points[m];
  points.resize(kept);
}

/// Measures a facet at these points; its `measured_mm2` stays 0 where there are none.
void measure(FacetRoughness& facet, const std::vector<std::uint32_t>& points,
             const SurfaceErrors& errors, double cutoff_mm) {
  // Directions within the facet that depend on its normal alone.
  const Vec3d aside = std::abs(facet.normal.x()) < 0.6 ? Vec3d(1, 0, 0) : Vec3d(0, 1, 0);
  const Vec3d u = facet.normal.cross(aside).unit();
  const Vec3d v = facet.normal.cross(u);
  HeightField field;
  double sum = 0;
  for (const std::uint32_t point : points) {
    const Vec3d at(errors.nearest[point]);
    field.at_mm.emplace_back(at.dot(u), at.dot(v));
    field.height_mm.push_back(errors.error_mm[point]);
    field.weight.push_back(errors.weight_mm2[point]);
    facet.measured_mm2 += errors.weight_mm2[point];
    sum += errors.weight_mm2[point] * errors.error_mm[point];
  }
  if (!(facet.measured_mm2 > 0)) return;
  facet.bias_mm = sum / facet.measured_mm2;
  field.level();
  facet.sa_mm = field.meanSize();
  facet.sq_mm = field.rms();
  facet.sq_band_mm = field.rmsBeyond(cutoff_mm);
}

}  // namespace

std::vector<FacetRoughness> facetRoughness(const SurfaceErrors& errors,
                                           const ClosestPoints& reference,
                                           const RoughnessRules& rules) {
  const Mesh& mesh = reference.mesh();
  const std::vector<std::uint32_t> facet_of = facetsOf(mesh);
  const ChosenFacets chosen = chosenFacets(mesh, facet_of, rules);
  const MeshEdges edges(mesh);
  const auto facet_edges = edgesByFacet(edges, facet_of, chosen);
  auto points = pointsByFacet(errors, facet_of, chosen);
  std::vector<FacetRoughness> result;
  for (std::size_t n = 0; n < chosen.facets.size(); ++n) {
    FacetRoughness facet = chosen.facets[n];
    facet.normal.normalize();
    const Mesh border = borderOf(mesh, edges, facet_of, chosen.numbers[n], facet_edges[n]);
    dropNear(border, rules.margin_mm, errors, points[n]);
    measure(facet, points[n], errors, rules.cutoff_mm);
    if (facet.measured_mm2 > 0) result.push_back(facet);
  }
  return result;
}

}  // namespace vdbdither
