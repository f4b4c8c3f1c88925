#pragma once

#include <span>

#include "vdbdither/model/grid.h"
#include "vdbdither/model/lattice.h"

namespace vdbdither {

/// A grid and the layers of it that count.
struct GridLayers {
  GridConstPtr grid;
  ZRange range;
};

/// One grid of the layers of all `pieces` within `wanted`, and background elsewhere. The pieces
/// agree in type, background, transform and metadata, and their
/// ranges meet at multiples of eight. A piece that
/// is all of the result comes back itself; otherwise nodes are copied. Throws DataError for a grid
/// type that slabs cannot carry (points, strings).
GridConstPtr joinLayers(std::span<const GridLayers> pieces, ZRange wanted);

/// Adds the layers of `pieces` within `wanted` to `grid`, which has those of `own` already; `own`
/// meets the ranges of the pieces at multiples of eight. False, and nothing is done, where `grid`
/// has something outside the leaves of `own`.
bool addLayers(openvdb::GridBase& grid, ZRange own, std::span<const GridLayers> pieces,
               ZRange wanted);

/// The canonical form: nodes of one value and state are tiles, so that topology depends on the
/// voxels alone.
GridConstPtr pruned(const GridConstPtr& grid);

/// Bytes and active voxels of a grid.
struct GridSize {
  double bytes = 0;
  double active_voxels = 0;
};
GridSize sizeOf(const GridConstPtr& grid);

/// Bytes that a leaf node of `grid` takes in memory.
double leafBytes(const GridConstPtr& grid);

}  // namespace vdbdither
