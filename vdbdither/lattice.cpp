#include "vdbdither/lattice.h"

#include <algorithm>

namespace vdbdither {

namespace {

int floorToLeaf(int z) { return z & ~(leaf_layers - 1); }

}  // namespace

ZRange alignedToLeaves(ZRange range) {
  if (range.empty()) return {floorToLeaf(range.begin), floorToLeaf(range.begin)};
  return {floorToLeaf(range.begin), floorToLeaf(range.end + leaf_layers - 1)};
}

ZRange intersection(ZRange a, ZRange b) {
  const int begin = std::max(a.begin, b.begin);
  return {begin, std::max(begin, std::min(a.end, b.end))};
}

}  // namespace vdbdither
