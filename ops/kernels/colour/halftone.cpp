// Thresholds against cumulative coverages, as multi-toning with one mask does: Lau, Arce: Modern
// Digital Halftoning, 2nd edition (2008), chapter 7; here for the voxels of a solid.

#include "ops/kernels/colour/halftone.h"

#include <algorithm>
#include <memory>
#include <numeric>

#include <tbb/parallel_for.h>

#include "ops/kernels/leaf/leaf_origins.h"
#include "ops/kernels/leaf/node_writer.h"
#include "ops/kernels/leaf/split_tiles.h"

namespace vdbdither {

using openvdb::Coord;
using openvdb::FloatGrid;
using openvdb::FloatTree;
using openvdb::Int32Tree;

Int32Tree::Ptr Halftone::run(const openvdb::BoolTree& solid, const CoverageSource& source,
                             std::int32_t bare, ZRange core) const {
  Int32Tree::Ptr material = valueWhereActive(solid, bare);
  openvdb::CoordBBox box;
  if (!solid.evalActiveVoxelBoundingBox(box)) return material;
  if (box.min().z() < core.begin || box.max().z() >= core.end) {
    box.min().z() = core.begin;
    box.max().z() = core.end - 1;
    material->clip(box);
  }
  {
    const auto reader = source.reader();
    splitTiles(*material, [&](const Coord& origin) { return reader->visit(origin); });
  }
  std::vector<Int32Tree::LeafNodeType*> leaves;
  material->getNodes(leaves);
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, leaves.size()), [&](const auto& range) {
    const auto reader = source.reader();
    std::vector<float> coverages(order_.size());
    for (std::size_t n = range.begin(); n != range.end(); ++n) {
      Int32Tree::LeafNodeType& leaf = *leaves[n];
      if (!reader->visit(leaf.origin())) continue;
      std::int32_t* values = leaf.buffer().data();
      for (auto voxel = leaf.cbeginValueOn(); voxel; ++voxel) {
        if (!reader->read(voxel.pos(), coverages)) continue;
        const float threshold = mask_(voxel.getCoord());
        // The last takes what is left: sums of single precision may stay below the threshold.
        std::size_t place = 0;
        float sum = coverages[order_[0]];
        while (sum <= threshold && place + 1 < order_.size()) sum += coverages[order_[++place]];
        while (place > 0 && coverages[order_[place]] == 0) --place;
        values[voxel.pos()] = static_cast<std::int32_t>(order_[place]) + 1;
      }
    }
  });
  return material;
}

std::vector<std::size_t> darkestFirst(const InkSet& set) {
  const auto luminance = [&](std::size_t ink) { return luminanceOf(set.linear_rgb[ink]); };
  std::vector<std::size_t> order;
  for (std::size_t ink = 0; ink < set.inks.size(); ++ink)
    if (ink != set.clear) order.push_back(ink);
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return luminance(a) < luminance(b); });
  if (set.clear) order.insert(order.end() - 1, *set.clear);
  return order;
}

FloatGrid::Ptr makeCoverageGrid(const openvdb::math::Transform& transform) {
  auto grid = FloatGrid::create(0.0F);
  grid->setTransform(transform.copy());
  grid->setGridClass(openvdb::GRID_FOG_VOLUME);
  return grid;
}

std::vector<FloatGrid::Ptr> coverageGrids(const openvdb::Vec3SGrid& colour,
                                          const CoverageSource& source, std::size_t inks,
                                          ZRange core) {
  std::vector<Coord> origins;
  appendLeafOrigins(colour.tree(), core, origins);
  appendTileOrigins(colour.tree(), core, origins);
  using Leaf = FloatTree::LeafNodeType;
  std::vector<std::vector<std::unique_ptr<Leaf>>> made(inks);
  for (auto& leaves : made) leaves.resize(origins.size());
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, origins.size()), [&](const auto& range) {
    const auto reader = source.reader();
    std::vector<float> coverages(inks);
    for (std::size_t n = range.begin(); n != range.end(); ++n) {
      if (!reader->visit(origins[n])) continue;
      for (auto& leaves : made) {
        leaves[n].reset(newLeaf<FloatTree>(origins[n]));
        std::fill_n(leaves[n]->buffer().data(), Leaf::SIZE, 0.0F);
      }
      const std::uint8_t within = rowWithin(origins[n].z(), core);
      for (unsigned offset = 0; offset < Leaf::SIZE; ++offset) {
        if ((within >> offset % leaf_layers & 1U) == 0 || !reader->read(offset, coverages))
          continue;
        for (std::size_t ink = 0; ink < inks; ++ink)
          made[ink][n]->setValueOn(offset, coverages[ink]);
      }
    }
  });
  std::vector<FloatGrid::Ptr> grids;
  for (auto& leaves : made) {
    grids.push_back(makeCoverageGrid(colour.transform()));
    for (auto& leaf : leaves)
      if (leaf && !leaf->isEmpty()) grids.back()->tree().addLeaf(leaf.release());
  }
  return grids;
}

}  // namespace vdbdither
