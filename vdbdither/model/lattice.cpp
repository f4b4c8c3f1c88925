#include "vdbdither/model/lattice.h"

#include <algorithm>

#include <openvdb/math/Transform.h>

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

std::shared_ptr<openvdb::math::Transform> transformOf(const Lattice& lattice) {
  using namespace openvdb::math;
  if (lattice.origin_mm == openvdb::Vec3d(0, 0, 0))
    return std::make_shared<Transform>(std::make_shared<ScaleMap>(lattice.pitch_mm));
  return std::make_shared<Transform>(
      std::make_shared<ScaleTranslateMap>(lattice.pitch_mm, lattice.origin_mm));
}

}  // namespace vdbdither
