#pragma once

#include <optional>

#include <openvdb/openvdb.h>

#include "ops/kernels/distance/height_map.h"
#include "vdbdither/model/lattice.h"

namespace vdbdither {

/// A displaced distance field (A. Brunton, L. Abu Rmaileh, "Displaced signed distance
/// fields for additive manufacturing", ACM TOG 40(4), 2021): d′(v) = d(v) − h, where h is the
/// height at the point of the surface that v belongs to; outwards is positive. With h = −f and the
/// point at v̄ it is eq. (3) of shape dithering (Morsy, Brunton, Urban 2022).
///
/// d′ is a distance where h is constant: exact outside of what grows, and, behind the re-entrant
/// edges that growing makes, too small as that of a union. Where h varies, |∇d′| is √(1 + |∇h|²).
/// A centre on a surface moved by a constant is inside where d′ falls towards the point shifted by
/// (ε, ε³, ε²).
struct SurfaceOffset {
  enum class At {
    closest,  ///< the closest surface voxel v̄: a column of voxels shares one height
    foot,     ///< the foot point c(v) − d(v)·n(v)
  };

  Lattice lattice;
  double constant_mm = 0;        ///< everywhere
  std::optional<HeightMap> map;  ///< added to it
  bool from_grid = false;        ///< added to it: a grid of heights in mm
  double grid_limit_mm = 0;      ///< no |value| of the grid is greater
  At at = At::closest;
  double held_mm = 0;  ///< the band of d

  /// No |h| is greater.
  [[nodiscard]] double greatestMm() const;
  /// The band of d′.
  [[nodiscard]] float backgroundMm() const { return static_cast<float>(held_mm - greatestMm()); }

  struct Layers {
    int surface = 0;
    int heights = 0;
  };
  [[nodiscard]] Layers reach() const;

  /// d′ over `core`. Voxels whose v̄ is not found, or that have no normal, have the constant alone.
  /// Throws DataError where a height of the grid exceeds the limit.
  ///
  /// \param heights  the grid, where `from_grid`, else null
  [[nodiscard]] openvdb::FloatGrid::Ptr run(const openvdb::FloatGrid& surface,
                                            const openvdb::FloatGrid* heights, ZRange core,
                                            ZRange valid) const;

 private:
  [[nodiscard]] bool varies() const { return map.has_value() || from_grid; }
  [[nodiscard]] double searchRadiusMm() const { return held_mm + lattice.diagonalMm(); }
};

}  // namespace vdbdither
