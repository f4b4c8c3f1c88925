#include "ops/kernels/measure/grid_summary.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_reduce.h>

#include "vdbdither/model/visit_grid.h"

namespace vdbdither {

using openvdb::CoordBBox;
using openvdb::Vec3d;

namespace {

template <typename T>
Vec3d asVector(const T& value) {
  if constexpr (openvdb::VecTraits<T>::IsVec) {
    return Vec3d(value);
  } else {
    return {static_cast<double>(value), 0, 0};
  }
}

/// Adds values one by one.
class Collector {
 public:
  explicit Collector(GridSummary& summary) : summary_(summary) {}

  template <typename Value>
  void add(const Value& value, std::uint64_t voxels) {
    const Vec3d at = asVector(value);
    const bool first = summary_.active_voxels == 0;
    summary_.minimum = first ? at : openvdb::math::minComponent(summary_.minimum, at);
    summary_.maximum = first ? at : openvdb::math::maxComponent(summary_.maximum, at);
    summary_.active_voxels += voxels;
    if constexpr (std::is_same_v<Value, std::int32_t>) {
      // Consecutive values are mostly equal, which avoids the search.
      if (!count_ || count_->first != value) count_ = &*summary_.counts.try_emplace(value).first;
      count_->second += voxels;
    }
  }

 private:
  GridSummary& summary_;
  std::pair<const std::int64_t, std::uint64_t>* count_ = nullptr;
};

}  // namespace

void GridSummary::add(const GridSummary& other) {
  leaves += other.leaves;
  leaf_bytes += other.leaf_bytes;
  if (other.active_voxels == 0) return;
  minimum = active_voxels ? openvdb::math::minComponent(minimum, other.minimum) : other.minimum;
  maximum = active_voxels ? openvdb::math::maxComponent(maximum, other.maximum) : other.maximum;
  active_voxels += other.active_voxels;
  box.expand(other.box);
  for (const auto& [value, voxels] : other.counts) counts[value] += voxels;
}

GridSummary gridSummary(const openvdb::GridBase& grid) {
  GridSummary summary;
  visitGrid(grid, [&](const auto& typed) {
    using Leaf = typename std::decay_t<decltype(typed)>::TreeType::LeafNodeType;
    std::vector<const Leaf*> leaves;
    typed.tree().getNodes(leaves);
    summary = tbb::parallel_reduce(
        tbb::blocked_range<std::size_t>(0, leaves.size(), 64), GridSummary{},
        [&](const tbb::blocked_range<std::size_t>& range, GridSummary sum) {
          Collector collector(sum);
          for (std::size_t i = range.begin(); i < range.end(); ++i) {
            for (auto value = leaves[i]->cbeginValueOn(); value; ++value) collector.add(*value, 1);
            leaves[i]->evalActiveBoundingBox(sum.box);
            ++sum.leaves;
            sum.leaf_bytes += leaves[i]->memUsage();
          }
          return sum;
        },
        [](GridSummary a, const GridSummary& b) {
          a.add(b);
          return a;
        });
    auto tile = typed.tree().cbeginValueOn();
    tile.setMaxDepth(std::decay_t<decltype(tile)>::LEAF_DEPTH - 1);
    Collector collector(summary);
    for (; tile; ++tile) {
      collector.add(*tile, tile.getVoxelCount());
      CoordBBox box;
      tile.getBoundingBox(box);
      summary.box.expand(box);
    }
  });
  return summary;
}

}  // namespace vdbdither
