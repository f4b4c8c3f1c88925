#pragma once

#include <array>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "ops/kernels/contour/iso_surface.h"
#include "vdbdither/model/grid.h"
#include "vdbdither/model/known_grids.h"

namespace vdbdither {

/// The grids that have a surface as it is printed or meant, the furthest down a chain first.
inline constexpr std::array<std::string_view, 4> surface_grids{printed_grid, solid_grid,
                                                               displaced_grid, surface_grid};

/// `wanted`, or without it the first of `surface_grids` that `there` holds. Throws DataError where
/// it is not there.
std::string chosenSurfaceGrid(std::span<const std::string> there,
                              const std::optional<std::string>& wanted);

/// The surface that a grid stands for: of a bool grid its voxels, of a level set the level 0, of a
/// fog volume (an occupancy) the level ½.
class GridSurface {
 public:
  /// About how many vertices it has in a leaf that it crosses; triangles are twice as many.
  static constexpr double vertices_per_leaf = 55;

  /// `prototype`: a grid of the kind that is to come. `level`: another level, in the grid's own
  /// unit. Throws DataError where the grid has no surface, or not at that level.
  GridSurface(const Lattice& lattice, const openvdb::GridBase& prototype,
              std::optional<double> level);

  /// The next layers; see IsoSurface.
  SurfacePiece add(const GridConstPtr& grid, ZRange layers);
  SurfacePiece finish() { return surface_.finish(); }

  /// Which voxels of the layers are inside.
  [[nodiscard]] std::vector<BitLayer> insideOf(const GridConstPtr& grid, ZRange layers) const;
  [[nodiscard]] const BitFrame& frame() const { return surface_.frame(); }

 private:
  static IsoSurface surfaceOf(const Lattice& lattice, const openvdb::GridBase& prototype,
                              std::optional<double> level);

  IsoSurface surface_;
};

}  // namespace vdbdither
