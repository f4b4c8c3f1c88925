#include "ops/kernels/colour/csg_colours.h"

#include <algorithm>
#include <cstddef>
#include <memory>
#include <utility>
#include <vector>

#include <tbb/parallel_for.h>

#include "ops/kernels/leaf/leaf_origins.h"
#include "ops/kernels/leaf/node_writer.h"

namespace vdbdither {

using openvdb::Coord;
using openvdb::FloatGrid;

namespace {

enum class Taken { a, b };

/// Whose value a voxel takes, and whether it takes that of the other part where there is none.
struct Decision {
  Taken taken;
  bool or_other;
};

Decision decide(float a, float b, Csg operation, bool b_first) {
  switch (operation) {
    case Csg::unite:
      if (a < 0 && b < 0) return {b_first ? Taken::b : Taken::a, true};
      return {b < a ? Taken::b : Taken::a, false};
    case Csg::intersect:
      return {b > a ? Taken::b : Taken::a, a < 0 && b < 0};
    case Csg::subtract:
      return {-b > a ? Taken::b : Taken::a, a < 0 && b > 0};
  }
  return {};
}

}  // namespace

template <class GridT>
typename GridT::Ptr combinedValues(const FloatGrid& a, const FloatGrid& b, const GridT* of_a,
                                   const GridT* of_b, Csg operation, bool b_first, ZRange core) {
  using TreeT = typename GridT::TreeType;
  using Leaf = typename TreeT::LeafNodeType;
  const GridT& like = of_a != nullptr ? *of_a : *of_b;
  std::vector<Coord> origins;
  for (const GridT* grid : {of_a, of_b})
    if (grid != nullptr) appendLeafOrigins(grid->tree(), core, origins);
  sortOnce(origins);

  std::vector<std::unique_ptr<Leaf>> made(origins.size());
  tbb::parallel_for(std::size_t{0}, origins.size(), [&](std::size_t n) {
    const openvdb::tree::ValueAccessor<const openvdb::FloatTree, false> distance_a(a.tree());
    const openvdb::tree::ValueAccessor<const openvdb::FloatTree, false> distance_b(b.tree());
    const auto leafOf = [&](const GridT* grid) {
      return grid != nullptr ? grid->tree().probeConstLeaf(origins[n]) : nullptr;
    };
    const Leaf* leaf_a = leafOf(of_a);
    const Leaf* leaf_b = leafOf(of_b);
    const std::uint8_t within = rowWithin(origins[n].z(), core);
    made[n].reset(newLeaf<TreeT>(origins[n]));
    std::fill_n(made[n]->buffer().data(), Leaf::SIZE, like.background());
    for (openvdb::Index v = 0; v < Leaf::SIZE; ++v) {
      if ((within >> v % leaf_layers & 1U) == 0) continue;
      const Coord ijk = made[n]->offsetToGlobalCoord(v);
      const auto [taken, or_other] =
          decide(distance_a.getValue(ijk), distance_b.getValue(ijk), operation, b_first);
      const Leaf* first = taken == Taken::a ? leaf_a : leaf_b;
      const Leaf* second = taken == Taken::a ? leaf_b : leaf_a;
      if (first != nullptr && first->isValueOn(v)) {
        made[n]->setValueOn(v, first->getValue(v));
      } else if (or_other && second != nullptr && second->isValueOn(v)) {
        made[n]->setValueOn(v, second->getValue(v));
      }
    }
  });
  auto grid = GridT::create(like);  // its name, type and transform, without voxels
  for (auto& leaf : made)
    if (!leaf->isEmpty()) grid->tree().addLeaf(leaf.release());
  return grid;
}

template openvdb::Vec3SGrid::Ptr combinedValues(const FloatGrid&, const FloatGrid&,
                                                const openvdb::Vec3SGrid*,
                                                const openvdb::Vec3SGrid*, Csg, bool, ZRange);
template FloatGrid::Ptr combinedValues(const FloatGrid&, const FloatGrid&, const FloatGrid*,
                                       const FloatGrid*, Csg, bool, ZRange);

}  // namespace vdbdither
