#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include <openvdb/math/Vec3.h>

#include "ops/kernels/mesh/closest_point.h"
#include "vdbdither/model/mesh.h"

namespace vdbdither {

/// How far points of a surface lie from a reference: first the surface's vertices, in their order,
/// then points within triangles that are too large for their corners to stand for them.
struct SurfaceErrors {
  std::size_t vertices = 0;
  std::vector<double> error_mm;         ///< positive outside the reference
  std::vector<double> weight_mm2;       ///< the area that a point stands for
  std::vector<std::uint32_t> triangle;  ///< of the reference: where the nearest point lies
  std::vector<openvdb::Vec3s> nearest;  ///< that point, mm

  [[nodiscard]] std::size_t size() const { return error_mm.size(); }
};

/// Measures `surface` against `reference`. A triangle with a side longer than `spacing_mm` is cut
/// into n² equal ones, whose centres stand for it; of others each corner stands for a third.
/// `progress` is told how far it is, 0 … 1.
SurfaceErrors surfaceErrors(const Mesh& surface, const ClosestPoints& reference, double spacing_mm,
                            const std::function<void(double)>& progress = {});

/// What a set of errors comes to.
struct ErrorStatistics {
  double weight = 0;  ///< area in mm², or the count of points
  double bias_mm = 0;
  double mean_mm = 0;  ///< of |e|
  double rms_mm = 0;
  double most_mm = 0;  ///< of |e|
  /// The cumulative curve of |e|: the n-th is the least that n/1000 of the weight do not exceed.
  std::vector<double> quantiles_mm;

  [[nodiscard]] double percentile(double percent) const;
};

/// Of the points that carry area, by area.
ErrorStatistics statisticsByArea(const SurfaceErrors& errors);

/// Of the vertices, each counting as one.
ErrorStatistics statisticsByVertex(const SurfaceErrors& errors);

}  // namespace vdbdither
