#include "ops/kernels/leaf/sampled_grid.h"

#include <cmath>
#include <type_traits>
#include <utility>

#include <openvdb/tools/Prune.h>
#include <openvdb/tree/LeafManager.h>

#include "vdbdither/model/interrupt.h"

namespace vdbdither {

namespace {

using openvdb::Coord;
using openvdb::FloatGrid;
using openvdb::GridBase;
using openvdb::Vec3d;
using openvdb::Vec3SGrid;

using SampledGrids =
    openvdb::TypeList<FloatGrid, openvdb::DoubleGrid, Vec3SGrid, openvdb::Vec3DGrid>;
template <class GridT>
using ResultGrid =
    std::conditional_t<openvdb::VecTraits<typename GridT::ValueType>::IsVec, Vec3SGrid, FloatGrid>;

/// Sums in double.
double wide(double value) { return value; }
Vec3d wide(const openvdb::Vec3s& value) { return Vec3d(value); }
Vec3d wide(const Vec3d& value) { return value; }

/// Returns whether there is a sample at `index`, and sets it.
template <class GridT, class Result>
bool sample(typename GridT::ConstAccessor& values, const Vec3d& index, Result& result) {
  constexpr double furthest = 1 << 30;
  for (int axis = 0; axis < 3; ++axis) {
    if (!(std::abs(index[axis]) < furthest)) return false;
  }
  const Coord low = Coord::floor(index);
  const Vec3d behind = index - low.asVec3d();
  decltype(wide(result)) sum{0.0};
  double weights = 0;
  for (int corner = 0; corner < 8; ++corner) {
    const Coord step(corner & 1, (corner >> 1) & 1, corner >> 2);
    double weight = 1;
    for (int axis = 0; axis < 3; ++axis)
      weight *= step[axis] != 0 ? behind[axis] : 1 - behind[axis];
    typename GridT::ValueType value;
    if (weight == 0 || !values.probeValue(low + step, value)) continue;
    sum += weight * wide(value);
    weights += weight;
  }
  if (weights == 0) return false;
  result = Result(sum / weights);
  return true;
}

template <class GridT>
GridBase::Ptr sampledAt(const GridT& grid, const openvdb::Mat4d& index_from_mm,
                        const FloatGrid& surface, const Vec3d& pitch_mm, double outside_mm) {
  using TreeT = typename ResultGrid<GridT>::TreeType;
  using ValueT = typename TreeT::ValueType;
  const ValueT nothing = openvdb::zeroVal<ValueT>();
  auto tree = std::make_shared<TreeT>(surface.tree(), nothing, openvdb::TopologyCopy());
  openvdb::tree::LeafManager<TreeT> leaves(*tree);
  leaves.foreach ([&](typename TreeT::LeafNodeType& leaf, std::size_t /*index*/) {
    throwIfInterrupted();
    auto values = grid.getConstAccessor();
    const auto* distances = surface.tree().probeConstLeaf(leaf.origin());
    for (auto voxel = leaf.beginValueOn(); voxel; ++voxel) {
      ValueT value = nothing;
      const bool is_wanted = distances != nullptr && distances->getValue(voxel.pos()) <= outside_mm;
      if (is_wanted &&
          sample<GridT>(values, index_from_mm.transform(voxel.getCoord().asVec3d() * pitch_mm),
                        value)) {
        voxel.setValue(value);
      } else {
        voxel.setValueOff();
      }
    }
  });
  openvdb::tools::pruneInactive(*tree);
  const auto result = ResultGrid<GridT>::create(tree);
  result->setTransform(surface.transform().copy());
  return result;
}

}  // namespace

bool SampledGrid::takes(const GridBase& grid) {
  return grid.apply<SampledGrids>([](const auto&) {});
}

SampledGrid::SampledGrid(GridBase::ConstPtr grid, const openvdb::Mat4d& mm_from_index)
    : grid_(std::move(grid)), index_from_mm_(mm_from_index.inverse()) {}

GridBase::Ptr SampledGrid::run(const FloatGrid& surface, const Vec3d& pitch_mm,
                               double outside_mm) const {
  GridBase::Ptr result;
  grid_->apply<SampledGrids>([&](const auto& typed) {
    result = sampledAt(typed, index_from_mm_, surface, pitch_mm, outside_mm);
  });
  return result;
}

double SampledGrid::memoryBytes() const { return static_cast<double>(grid_->memUsage()); }

}  // namespace vdbdither
