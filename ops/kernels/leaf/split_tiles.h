#pragma once

#include <cstdint>
#include <vector>

#include "ops/kernels/leaf/leaf_origins.h"
#include "vdbdither/model/lattice.h"
#include "vdbdither/model/openvdb.h"

namespace vdbdither {

/// Returns a tree of the topology of `solid` with `value` in every active voxel and 0 elsewhere.
openvdb::Int32Tree::Ptr valueWhereActive(const openvdb::BoolTree& solid, std::int32_t value);

/// Breaks the active tiles of `tree` up: where `is_split(origin)` holds, which is asked for the
/// origin of every leaf that they cover, comes a leaf; elsewhere are tiles of a leaf's size, unless
/// the tile has that size already.
template <typename IsSplit>
void splitTiles(openvdb::Int32Tree& tree, const IsSplit& is_split) {
  struct Tile {
    openvdb::CoordBBox box;
    std::int32_t value;
  };
  std::vector<Tile> tiles;
  const openvdb::Int32Tree& before = tree;
  auto found = before.cbeginValueOn();
  found.setMaxDepth(openvdb::Int32Tree::ValueOnCIter::LEAF_DEPTH - 1);
  for (; found; ++found) tiles.push_back({found.getBoundingBox(), found.getValue()});
  for (const auto& [box, value] : tiles) {
    forEachLeafOrigin(box, [&tree, &is_split, is_large = box.dim().x() > leaf_layers,
                            on = value](const openvdb::Coord& at) {
      if (is_split(at)) {
        tree.touchLeaf(at);
      } else if (is_large) {
        tree.addTile(1, at, on, true);
      }
    });
  }
}

}  // namespace vdbdither
