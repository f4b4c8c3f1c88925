#pragma once

#include <optional>

#include <openvdb/openvdb.h>

#include "ops/kernels/distance/height_map.h"
#include "vdbdither/model/lattice.h"

namespace vdbdither {

/// A displaced distance field (Brunton, Abu Rmaileh 2021): d′(v) = d(v) − h, where h is the height
/// at the point of the surface that v belongs to, positive outwards. With h = −f and the point at
/// v̄ this is eq. (3) of shape dithering (Morsy, Brunton, Urban 2022).
///
/// Where h is constant, d′ is a distance: exact outside a growing part, and too small behind its
/// re-entrant edges, as that of a union is. Where h varies, |∇d′| is √(1 + |∇h|²).
/// A centre on a surface moved by a constant is inside if d′ falls towards the point shifted by
/// (ε, ε³, ε²).
struct SurfaceOffset {
  enum class At {
    closest,  ///< the closest surface voxel v̄, which a column of voxels shares
    foot,     ///< the foot point c(v) − d(v)·n(v)
  };

  Lattice lattice;
  double constant_mm = 0;        ///< the same everywhere
  std::optional<HeightMap> map;  ///< added to the constant
  bool from_grid = false;        ///< adds a grid of heights in mm as well
  double grid_limit_mm = 0;      ///< the maximum |value| of the grid
  At at = At::closest;
  double held_mm = 0;  ///< the band of d

  /// The maximum |h|.
  [[nodiscard]] double maximumMm() const;
  /// The band of d′.
  [[nodiscard]] float backgroundMm() const { return static_cast<float>(held_mm - maximumMm()); }

  struct Reach {
    int surface = 0;
    int heights = 0;
  };
  [[nodiscard]] Reach reach() const;

  /// Returns d′ over `core`. Voxels whose v̄ is not found, or that have no normal, are displaced by
  /// the constant alone. Throws DataError if a height of the grid exceeds the limit.
  ///
  /// \param heights  the grid if `from_grid`, otherwise null
  [[nodiscard]] openvdb::FloatGrid::Ptr run(const openvdb::FloatGrid& surface,
                                            const openvdb::FloatGrid* heights, ZRange core,
                                            ZRange valid) const;

 private:
  [[nodiscard]] bool varies() const { return map.has_value() || from_grid; }
  [[nodiscard]] double searchRadiusMm() const { return held_mm + lattice.diagonalMm(); }
};

}  // namespace vdbdither
