#include "ops/kernels/dither/block_order.h"

#include <algorithm>

#include "ops/kernels/leaf/floor_divided.h"

namespace vdbdither {

BlockOrder::BlockOrder(const openvdb::Coord& reach) {
  const openvdb::Coord minimum(2, 2, 1);
  for (int axis = 0; axis < 3; ++axis)
    edges_[axis] =
        leaf_layers * std::max(minimum[axis], (reach[axis] + leaf_layers - 1) / leaf_layers);
}

openvdb::Coord BlockOrder::blockOf(const openvdb::Coord& ijk) const {
  return {floorDivided(ijk.x(), edges_.x()), floorDivided(ijk.y(), edges_.y()),
          floorDivided(ijk.z(), edges_.z())};
}

openvdb::Coord BlockOrder::cornerOf(const openvdb::Coord& ijk) const {
  const openvdb::Coord block = blockOf(ijk);
  return {block.x() * edges_.x(), block.y() * edges_.y(), block.z() * edges_.z()};
}

ZRange BlockOrder::needed(ZRange core, int sweeps) const {
  if (core.empty()) return core;
  int first = floorDivided(core.begin, edges_.z());
  int last = floorDivided(core.end - 1, edges_.z());
  // An odd layer needs the even ones beside it; in the sweeps before, they need their neighbours.
  first -= first & 1;
  last += last & 1;
  first -= 2 * (sweeps - 1);
  last += 2 * (sweeps - 1);
  return {first * edges_.z(), (last + 1) * edges_.z()};
}

}  // namespace vdbdither
