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

/// Sorts origins and drops those that are there twice.
inline void sortOnce(std::vector<openvdb::Coord>& origins) {
  std::sort(origins.begin(), origins.end());
  origins.erase(std::unique(origins.begin(), origins.end()), origins.end());
}

}  // namespace vdbdither
