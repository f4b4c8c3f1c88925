// Thresholds against cumulative coverages, as multi-toning with one mask does: Lau, Arce: Modern
// Digital Halftoning, 2nd edition (2008), chapter 7; here for the voxels of a solid.

#include "ops/kernels/colour/halftone.h"

#include <algorithm>
#include <array>
#include <bit>
#include <memory>
#include <numeric>
#include <optional>

#include <tbb/parallel_for.h>

#include "ops/kernels/leaf/leaf_origins.h"
#include "ops/kernels/leaf/node_writer.h"
#include "ops/kernels/leaf/split_tiles.h"

namespace vdbdither {

using openvdb::Coord;
using openvdb::FloatGrid;
using openvdb::FloatTree;
using openvdb::Int32Tree;

namespace {

using Int32Leaf = Int32Tree::LeafNodeType;

/// The parts of the interval from 0 to 1 that materials have.
class Intervals {
 public:
  /// @param order  of the materials: indices in `coverages`
  void set(std::span<const std::size_t> order, std::span<const float> coverages) {
    materials_.clear();
    ends_.clear();
    float end = 0;
    for (const std::size_t material : order) {
      if (coverages[material] == 0) continue;
      end += coverages[material];
      materials_.push_back(static_cast<std::int32_t>(material) + 1);
      ends_.push_back(end);
    }
    // The last takes what is left: sums of single precision may stay below a threshold.
    ends_.pop_back();
  }

  /// Returns the material whose part holds a threshold, counted from 1. It counts rather than
  /// searches: branches of a search are mispredicted.
  [[nodiscard]] std::int32_t at(float threshold) const {
    std::size_t before = 0;
    for (const float end : ends_) before += end <= threshold ? 1 : 0;
    return materials_[before];
  }

 private:
  std::vector<std::int32_t> materials_;
  std::vector<float> ends_;  ///< of all but the last
};

}  // namespace

Int32Tree::Ptr Halftone::run(const openvdb::BoolTree& solid, const CoverageSource& source,
                             std::int32_t bare, ZRange core, const SurfaceColumns* columns) const {
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
  std::vector<Int32Leaf*> leaves;
  material->getNodes(leaves);
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, leaves.size()), [&](const auto& range) {
    const auto reader = source.reader();
    std::optional<SurfaceColumns::Reader> places;
    if (columns) places.emplace(*columns);
    std::vector<float> coverages(order_.size());
    Intervals intervals;
    std::array<float, leaf_layers> thresholds;
    for (std::size_t n = range.begin(); n != range.end(); ++n) {
      Int32Leaf& leaf = *leaves[n];
      if (!reader->visit(leaf.origin())) continue;
      const bool has_columns = places && places->visit(leaf.origin());
      std::int32_t* values = leaf.buffer().data();
      for (unsigned column = 0; column < Int32Leaf::SIZE; column += leaf_layers) {
        unsigned layers = leaf.getValueMask().getWord<std::uint8_t>(column / leaf_layers);
        if (layers != 0) layers &= reader->layersWith(column);
        if (layers == 0) continue;
        mask_.column(leaf.offsetToGlobalCoord(column), thresholds);
        if (has_columns && places->rowHasColumns(column)) {
          for (unsigned z = 0; z < leaf_layers; ++z)
            if (places->isInColumn(column + z)) thresholds[z] = mask_(places->place(column + z));
        }
        while (layers != 0) {
          const unsigned alike = reader->read(column, layers, coverages);
          intervals.set(order_, coverages);
          layers &= ~alike;
          for (unsigned left = alike; left != 0; left &= left - 1) {
            const auto z = static_cast<unsigned>(std::countr_zero(left));
            values[column + z] = intervals.at(thresholds[z]);
          }
        }
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
      for (unsigned column = 0; column < Leaf::SIZE; column += leaf_layers)
        for (unsigned layers = within & reader->layersWith(column); layers != 0;) {
          const unsigned alike = reader->read(column, layers, coverages);
          layers &= ~alike;
          for (unsigned left = alike; left != 0; left &= left - 1)
            for (std::size_t ink = 0; ink < inks; ++ink)
              made[ink][n]->setValueOn(column + static_cast<unsigned>(std::countr_zero(left)),
                                       coverages[ink]);
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
