#include "ops/kernels/leaf/part_values.h"

#include <algorithm>
#include <atomic>

#include <openvdb/tree/LeafManager.h>

#include "ops/kernels/leaf/split_tiles.h"
#include "vdbdither/model/errors.h"
#include "vdbdither/model/known_grids.h"

namespace vdbdither {

using openvdb::Coord;
using openvdb::Int32Tree;

void checkPartCount(const openvdb::Int32Grid& part, std::size_t given, const std::string& others,
                    const std::function<void(const std::string&)>& warn) {
  const auto text = [](std::size_t count, const std::string& what) {
    return std::to_string(count) + " " + what + (count == 1 ? "" : "s");
  };
  const auto count = part.getMetadata<openvdb::Int32Metadata>(part_count_key);
  if (!count) {
    warn("the grid 'part' does not say how many parts there are (its metadata " +
         std::string(part_count_key) + "); those beyond the " + text(given, "material") +
         " of --parts " + others);
  } else if (count->value() < 0 || static_cast<std::size_t>(count->value()) != given) {
    throw UsageError("--parts: " + text(given, "material") + " for " +
                     text(static_cast<std::size_t>(std::max(0, count->value())), "part") +
                     "; name one for each, in the order of the meshes");
  }
}

std::uint64_t takeParts(Int32Tree& values, const Int32Tree& part,
                        std::span<const std::int32_t> of_part, std::int32_t of_others) {
  std::atomic<std::uint64_t> others = 0;
  const auto valueOf = [&](std::int32_t index, std::int32_t there, std::uint64_t voxels) {
    const bool is_listed = index >= 1 && static_cast<std::size_t>(index) <= of_part.size();
    if (!is_listed) others += voxels;
    const std::int32_t value = is_listed ? of_part[static_cast<std::size_t>(index) - 1] : of_others;
    return value == 0 ? there : value;
  };
  const openvdb::tree::ValueAccessor<const Int32Tree> nodes(part);
  splitTiles(values, [&](const Coord& at) { return nodes.probeConstLeaf(at) != nullptr; });
  auto tile = values.beginValueOn();
  tile.setMaxDepth(Int32Tree::ValueOnIter::LEAF_DEPTH - 1);
  for (; tile; ++tile)
    tile.setValue(valueOf(part.getValue(tile.getCoord()), *tile, tile.getVoxelCount()));
  openvdb::tree::LeafManager<Int32Tree> leaves(values);
  leaves.foreach ([&](Int32Tree::LeafNodeType& leaf, std::size_t) {
    const openvdb::tree::ValueAccessor<const Int32Tree> accessor(part);
    for (auto voxel = leaf.beginValueOn(); voxel; ++voxel)
      voxel.setValue(valueOf(accessor.getValue(voxel.getCoord()), *voxel, 1));
  });
  return others;
}

}  // namespace vdbdither
