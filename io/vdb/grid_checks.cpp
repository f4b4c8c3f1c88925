#include "io/vdb/grid_checks.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <sstream>
#include <type_traits>
#include <vector>

#include <tbb/blocked_range.h>
#include <tbb/parallel_reduce.h>

#include "vdbdither/model/errors.h"
#include "vdbdither/model/known_grids.h"
#include "vdbdither/model/visit_grid.h"

namespace vdbdither {

using openvdb::BoolGrid;
using openvdb::Coord;

namespace {

constexpr const char* mend = "; mend it in the tool that it comes from";

template <typename T>
bool isFinite(const T& value) {
  if constexpr (openvdb::VecTraits<T>::IsVec) {
    return std::isfinite(value[0]) && std::isfinite(value[1]) && std::isfinite(value[2]);
  } else {
    return std::isfinite(value);
  }
}

template <typename T>
std::string textOf(const T& value) {
  std::ostringstream text;
  if constexpr (openvdb::VecTraits<T>::IsVec) {
    text << "(" << value[0] << " " << value[1] << " " << value[2] << ")";
  } else {
    text << value;
  }
  return text.str();
}

std::string textOf(const Coord& voxel) {
  return std::to_string(voxel.x()) + " " + std::to_string(voxel.y()) + " " +
         std::to_string(voxel.z());
}

/// The values of a leaf that are not finite are often many. The first in the order of the tree is
/// told, on any number of threads.
template <typename TreeT>
std::optional<std::string> notFiniteOf(const TreeT& tree) {
  using Leaf = typename TreeT::LeafNodeType;
  const auto says = [](const auto& value, const std::string& where) {
    return "holds " + textOf(value) + " " + where + ", which is not a finite number" + mend;
  };
  if (!isFinite(tree.background())) return says(tree.background(), "as its background");
  auto tile = tree.cbeginValueAll();
  tile.setMaxDepth(TreeT::ValueAllCIter::LEAF_DEPTH - 1);
  for (; tile; ++tile) {
    if (!isFinite(*tile)) return says(*tile, "at voxel " + textOf(tile.getCoord()));
  }
  std::vector<const Leaf*> leaves;
  tree.getNodes(leaves);
  const auto is_sound = [](const Leaf& leaf) {
    const auto* values = leaf.buffer().data();
    return std::all_of(values, values + Leaf::SIZE, [](const auto& v) { return isFinite(v); });
  };
  const std::size_t first = tbb::parallel_reduce(
      tbb::blocked_range<std::size_t>(0, leaves.size(), 64), leaves.size(),
      [&](const auto& range, std::size_t found) {
        for (std::size_t n = range.begin(); n < std::min(found, range.end()); ++n) {
          if (!is_sound(*leaves[n])) return n;
        }
        return found;
      },
      [](std::size_t a, std::size_t b) { return std::min(a, b); });
  if (first == leaves.size()) return std::nullopt;
  for (auto value = leaves[first]->cbeginValueAll(); value; ++value) {
    if (!isFinite(*value)) return says(*value, "at voxel " + textOf(value.getCoord()));
  }
  return std::nullopt;
}

bool holdsActiveFalse(const openvdb::BoolTree& tree) {
  auto tile = tree.cbeginValueOn();
  tile.setMaxDepth(openvdb::BoolTree::ValueOnCIter::LEAF_DEPTH - 1);
  for (; tile; ++tile) {
    if (!*tile) return true;
  }
  for (auto leaf = tree.cbeginLeaf(); leaf; ++leaf) {
    const auto* values = leaf->buffer().data();
    for (openvdb::Index n = 0; n < 8; ++n) {
      if ((leaf->getValueMask().getWord<openvdb::Index64>(n) & ~values[n]) != 0) return true;
    }
  }
  return false;
}

BoolGrid::Ptr withoutActiveFalse(const BoolGrid& grid) {
  BoolGrid::Ptr copy = grid.deepCopy();
  for (auto value = copy->beginValueOn(); value; ++value) {
    if (!*value) value.setValueOff();
  }
  return copy;
}

/// Level sets, and `surface` of a tool that leaves the class open.
bool holdsDistances(const openvdb::GridBase& grid) {
  return grid.getGridClass() == openvdb::GRID_LEVEL_SET ||
         (grid.getGridClass() == openvdb::GRID_UNKNOWN && grid.getName() == surface_grid);
}

}  // namespace

bool isCountable(const Coord& index) {
  constexpr std::int64_t farthest = std::int64_t{1} << 30;
  for (int axis = 0; axis < 3; ++axis) {
    if (std::abs(std::int64_t{index[axis]}) > farthest) return false;
  }
  return true;
}

std::optional<std::string> faultOf(const openvdb::GridBase& grid) {
  std::optional<std::string> fault;
  grid.apply<CarriedGrids>([&](const auto& typed) {
    using ValueT = typename std::decay_t<decltype(typed)>::ValueType;
    constexpr bool has_fractions =
        openvdb::VecTraits<ValueT>::IsVec || std::is_floating_point_v<ValueT>;
    if constexpr (has_fractions) fault = notFiniteOf(typed.tree());
    if constexpr (std::is_floating_point_v<ValueT>) {
      if (!fault && holdsDistances(typed) && typed.background() < 0) {
        fault = "holds distances with the background " + textOf(typed.background()) +
                ", so that everything beyond its voxels is inside" + mend;
      }
    }
    if constexpr (std::is_same_v<ValueT, bool>) {
      if (typed.background() && typed.getName() == solid_grid)
        fault = std::string("has the background true, so that everything beyond its voxels is in") +
                mend;
    }
  });
  return fault;
}

GridConstPtr checked(const Grids::value_type& grid, const std::string& where) {
  if (const auto fault = faultOf(*grid.second))
    throw DataError(where + ": grid '" + grid.first + "' " + *fault);
  return grid.second;
}

void admitGrids(Grids& grids, const std::string& where) {
  for (auto& grid : grids) {
    checked(grid, where);
    if (const auto voxels = openvdb::GridBase::grid<BoolGrid>(grid.second);
        voxels && holdsActiveFalse(voxels->tree()))
      grid.second = withoutActiveFalse(*voxels);
  }
}

}  // namespace vdbdither
