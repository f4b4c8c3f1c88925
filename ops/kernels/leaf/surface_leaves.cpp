#include "ops/kernels/leaf/surface_leaves.h"

#include <algorithm>
#include <cmath>

#include <openvdb/tools/Prune.h>

#include "ops/kernels/leaf/held_band.h"

namespace vdbdither {

using openvdb::Coord;
using openvdb::FloatGrid;

LeafValues LeafValues::of(
    const openvdb::tree::ValueAccessor<const openvdb::FloatTree, false>& surface,
    const Coord& origin) {
  LeafValues values;
  if (const FloatLeaf* leaf = surface.probeConstLeaf(origin)) {
    std::copy_n(leaf->buffer().data(), values.distance.size(), values.distance.begin());
    for (unsigned x = 0; x < 8; ++x)
      values.active[x] = leaf->getValueMask().getWord<std::uint64_t>(x);
  } else {
    float value = 0;
    const bool active = surface.probeValue(origin, value);
    values.distance.fill(value);
    values.active.fill(active ? ~std::uint64_t{0} : 0);
  }
  return values;
}

FloatGrid::Ptr emptySurface(const FloatGrid& surface, float background_mm) {
  FloatGrid::Ptr grid = FloatGrid::create(background_mm);
  grid->insertMeta(surface);
  grid->setTransform(surface.transform().copy());
  setHeldBandMm(*grid, double{background_mm});
  return grid;
}

FloatGrid::Ptr surfaceOf(const FloatGrid& prototype, float background_mm, ZRange core,
                         std::span<const Coord> origins, std::span<const LeafValues> leaves,
                         std::span<const openvdb::CoordBBox> inside) {
  FloatGrid::Ptr grid = emptySurface(prototype, background_mm);
  for (const openvdb::CoordBBox& box : inside) grid->tree().sparseFill(box, -background_mm, false);

  std::vector<std::unique_ptr<FloatLeaf>> made(leaves.size());
  tbb::parallel_for(std::size_t{0}, leaves.size(), [&](std::size_t n) {
    const std::uint8_t within = rowWithin(origins[n].z(), core);
    if (within == 0) return;
    made[n] = std::make_unique<FloatLeaf>(origins[n], background_mm, false);
    FloatLeaf& leaf = *made[n];
    float* out = leaf.buffer().data();
    for (unsigned offset = 0; offset < 512; ++offset) {
      if (!(within >> (offset % 8) & 1U)) continue;
      const float d = leaves[n].distance[offset];
      const bool active =
          (leaves[n].active[offset / 64] >> (offset % 64) & 1U) != 0 && std::abs(d) < background_mm;
      out[offset] = active ? d : std::copysign(background_mm, d);
      if (active) leaf.setActiveState(offset, true);
    }
  });
  for (auto& leaf : made) {
    if (leaf) grid->tree().addLeaf(leaf.release());
  }
  openvdb::tools::prune(grid->tree());
  return grid;
}

}  // namespace vdbdither
