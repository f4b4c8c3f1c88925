#pragma once

#include <algorithm>
#include <vector>

#include <openvdb/openvdb.h>

#include "ops/kernels/leaf/leaf_bits.h"

namespace vdbdither {

/// Appends the origins of the leaves that hold layers of `core`.
template <class Tree>
void appendLeafOrigins(const Tree& tree, ZRange core, std::vector<openvdb::Coord>& origins) {
  for (auto leaf = tree.cbeginLeaf(); leaf; ++leaf)
    if (rowWithin(leaf->origin().z(), core) != 0) origins.push_back(leaf->origin());
}

/// Calls `visit` with the origins of the leaves that `box` consists of.
template <typename Visit>
void forEachLeafOrigin(const openvdb::CoordBBox& box, const Visit& visit) {
  for (int x = box.min().x(); x <= box.max().x(); x += leaf_layers)
    for (int y = box.min().y(); y <= box.max().y(); y += leaf_layers)
      for (int z = box.min().z(); z <= box.max().z(); z += leaf_layers)
        visit(openvdb::Coord(x, y, z));
}

/// Appends the origins of the leaves that active tiles stand for and that hold layers of `core`.
template <class Tree>
void appendTileOrigins(const Tree& tree, ZRange core, std::vector<openvdb::Coord>& origins) {
  auto tile = tree.cbeginValueOn();
  tile.setMaxDepth(Tree::ValueOnCIter::LEAF_DEPTH - 1);
  for (; tile; ++tile)
    forEachLeafOrigin(tile.getBoundingBox(), [&](const openvdb::Coord& origin) {
      if (rowWithin(origin.z(), core) != 0) origins.push_back(origin);
    });
}

/// Sorts origins and drops those that are there twice.
inline void sortOnce(std::vector<openvdb::Coord>& origins) {
  std::sort(origins.begin(), origins.end());
  origins.erase(std::unique(origins.begin(), origins.end()), origins.end());
}

}  // namespace vdbdither
