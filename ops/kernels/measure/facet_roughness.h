#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "ops/kernels/measure/surface_error.h"
#include "ops/kernels/mesh/closest_point.h"

namespace vdbdither {

/// For every triangle the number of its planar facet, from 0 by lowest triangle: triangles that
/// hang together and face within 0.01° where the facet's first one does.
std::vector<std::uint32_t> facetsOf(const Mesh& mesh);

/// How rough a planar facet was printed: the errors on it after the best plane is taken away.
struct FacetRoughness {
  std::uint32_t triangle = 0;  ///< the lowest of the facet
  openvdb::Vec3d normal;
  double area_mm2 = 0;      ///< of the facet
  double measured_mm2 = 0;  ///< of the surface that was measured on it
  double bias_mm = 0;
  double sa_mm = 0;       ///< mean of |e| about the plane (ISO 25178-2)
  double sq_mm = 0;       ///< RMS about the plane
  double sq_band_mm = 0;  ///< RMS of what is longer than the cut-off
};

struct RoughnessRules {
  /// Wavelengths shorter than this do not count for the band: a Gaussian filter that halves them
  /// (ISO 16610-61).
  double cutoff_mm = 0.25;
  double margin_mm = 0.5;        ///< what lies nearer to the facet's edges is left out
  double least_area_mm2 = 1;     ///< smaller facets are left out
  std::size_t most_facets = 64;  ///< the largest are kept
};

/// The roughness of the reference's facets, largest first.
std::vector<FacetRoughness> facetRoughness(const SurfaceErrors& errors,
                                           const ClosestPoints& reference,
                                           const RoughnessRules& rules);

/// Heights over points of a plane.
struct HeightField {
  std::vector<openvdb::Vec2d> at_mm;
  std::vector<double> height_mm;
  std::vector<double> weight;

  /// Takes the least-squares plane away.
  void level();
  [[nodiscard]] double meanSize() const;
  [[nodiscard]] double rms() const;
  /// RMS of the means over pixels of an eighth of the cut-off, after the Gaussian filter.
  [[nodiscard]] double rmsBeyond(double cutoff_mm) const;
};

}  // namespace vdbdither
