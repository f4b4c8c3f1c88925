#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "ops/kernels/measure/surface_error.h"
#include "ops/kernels/mesh/closest_point.h"

namespace vdbdither {

/// Returns the number of every triangle's planar facet, counted from 0 by lowest triangle. A facet
/// is a connected set of triangles whose normals differ by less than 0.01° from that of its first.
std::vector<std::uint32_t> facetsOf(const Mesh& mesh);

/// The roughness of a planar facet: the errors measured on it, minus their least-squares plane.
struct FacetRoughness {
  std::uint32_t triangle = 0;  ///< the lowest of the facet
  openvdb::Vec3d normal;
  double area_mm2 = 0;      ///< of the facet
  double measured_mm2 = 0;  ///< of the surface that was measured on it
  double bias_mm = 0;
  double sa_mm = 0;       ///< mean of |e| about the plane (ISO 25178-2)
  double sq_mm = 0;       ///< RMS about the plane
  double sq_band_mm = 0;  ///< RMS of the wavelengths above the cut-off
};

struct RoughnessRules {
  /// The cut-off wavelength of the band: the one that the Gaussian filter halves (ISO 16610-61).
  double cutoff_mm = 0.25;
  double margin_mm = 0.5;           ///< points nearer to the facet's edges are left out
  double minimum_area_mm2 = 1;      ///< smaller facets are left out
  std::size_t maximum_facets = 64;  ///< the largest are kept
};

/// Returns the roughness of the reference's facets, largest first.
std::vector<FacetRoughness> facetRoughness(const SurfaceErrors& errors,
                                           const ClosestPoints& reference,
                                           const RoughnessRules& rules);

/// Heights over points of a plane.
struct HeightField {
  std::vector<openvdb::Vec2d> at_mm;
  std::vector<double> height_mm;
  std::vector<double> weight;

  /// Subtracts the least-squares plane.
  void level();
  [[nodiscard]] double meanSize() const;  ///< mean of the absolute heights
  [[nodiscard]] double rms() const;
  /// RMS of the means over pixels of an eighth of the cut-off, after the Gaussian filter.
  [[nodiscard]] double rmsBeyond(double cutoff_mm) const;
};

}  // namespace vdbdither
