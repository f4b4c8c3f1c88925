#pragma once

// The measure family: kernels that measure surfaces, voxels and grids and compare them.

#include <cstdint>
#include <functional>
#include <vector>

#include <openvdb/math/Vec3.h>

#include "ops/kernels/mesh/closest_point.h"
#include "vdbdither/model/mesh.h"

namespace vdbdither {

/// The distances of points of a surface from a reference: first the surface's vertices, in their
/// order, then points within triangles that are too large to be represented by their corners.
struct SurfaceErrors {
  std::size_t vertices = 0;
  std::vector<double> error_mm;         ///< positive outside the reference
  std::vector<double> weight_mm2;       ///< the area that a point represents
  std::vector<std::uint32_t> triangle;  ///< of the reference, on which the nearest point lies
  std::vector<openvdb::Vec3s> nearest;  ///< the nearest point, mm

  [[nodiscard]] std::size_t size() const { return error_mm.size(); }
};

/// Measures `surface` against `reference`. A triangle with a side longer than `spacing_mm` is
/// divided into n² equal ones and represented by their centres; the corners of others represent a
/// third each. `progress` receives fractions, 0 … 1.
SurfaceErrors surfaceErrors(const Mesh& surface, const ClosestPoints& reference, double spacing_mm,
                            const std::function<void(double)>& progress = {});

/// Statistics of a set of errors.
struct ErrorStatistics {
  double weight = 0;  ///< area in mm², or the count of points
  double bias_mm = 0;
  double mean_mm = 0;  ///< of |e|
  double rms_mm = 0;
  double maximum_mm = 0;  ///< of |e|
  /// The cumulative curve of |e|: the n-th is the smallest |e| that n/1000 of the weight do not
  /// exceed.
  std::vector<double> quantiles_mm;

  [[nodiscard]] double percentile(double percent) const;
};

/// Returns the statistics of the points that represent an area, weighted by area.
ErrorStatistics statisticsByArea(const SurfaceErrors& errors);

/// Returns the statistics of the vertices, all with the same weight.
ErrorStatistics statisticsByVertex(const SurfaceErrors& errors);

}  // namespace vdbdither
