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

/// The grids that have a printed or an intended surface, those that are made last in a chain first.
inline constexpr std::array<std::string_view, 4> surface_grids{printed_grid, solid_grid,
                                                               displaced_grid, surface_grid};

/// Returns `wanted`, or without it the first of `surface_grids` that is in `there`. Throws
/// DataError if there is none.
std::string chosenSurfaceGrid(std::span<const std::string> there,
                              const std::optional<std::string>& wanted);

/// The surface that a grid represents: the voxels of a bool grid, the level 0 of a level set, the
/// level ½ of a fog volume (an occupancy).
class GridSurface {
 public:
  /// The approximate number of vertices in a leaf that the surface crosses; there are twice as many
  /// triangles.
  static constexpr double vertices_per_leaf = 55;

  /// `prototype` is a grid of the kind to be added. `level` is another level, in the grid's own
  /// unit. Throws DataError if the grid has no surface, or none at this level.
  GridSurface(const Lattice& lattice, const openvdb::GridBase& prototype,
              std::optional<double> level);

  /// Adds the next layers; see IsoSurface.
  SurfacePiece add(const GridConstPtr& grid, ZRange layers);
  SurfacePiece finish() { return surface_.finish(); }

  /// Returns the voxels of the layers that are inside.
  [[nodiscard]] std::vector<BitLayer> insideOf(const GridConstPtr& grid, ZRange layers) const;
  [[nodiscard]] const BitLayout& layout() const { return surface_.layout(); }

 private:
  static IsoSurface surfaceOf(const Lattice& lattice, const openvdb::GridBase& prototype,
                              std::optional<double> level);

  IsoSurface surface_;
};

}  // namespace vdbdither
