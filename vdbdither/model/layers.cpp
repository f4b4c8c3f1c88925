#include "vdbdither/model/layers.h"

#include <algorithm>
#include <array>
#include <memory>
#include <vector>

#include <openvdb/tools/Prune.h>
#include <tbb/parallel_for.h>

#include "vdbdither/model/openvdb.h"
#include "vdbdither/model/visit_grid.h"

namespace vdbdither {

using openvdb::Coord;
using openvdb::CoordBBox;
using openvdb::GridBase;

namespace {

ZRange layersOf(const CoordBBox& box) { return {box.min().z(), box.max().z() + 1}; }

bool within(ZRange inner, ZRange outer) {
  return inner.begin >= outer.begin && inner.end <= outer.end;
}

/// Calls `on_tile(index)` or `on_child(node)` for every entry of an internal node's table that
/// holds some of `range`, and looks at no other.
template <typename Node, typename OnTile, typename OnChild>
void forEachEntry(const Node& node, ZRange range, const OnTile& on_tile, const OnChild& on_child) {
  constexpr int edge = 1 << Node::LOG2DIM;
  constexpr int step = static_cast<int>(Node::ChildNodeType::DIM);
  const ZRange layers = intersection(layersOf(node.getNodeBoundingBox()), range);
  if (layers.empty()) return;
  const int begin = (layers.begin - node.origin().z()) / step;
  const int end = (layers.end - node.origin().z() + step - 1) / step;
  for (int column = 0; column < edge * edge; ++column) {
    for (int z = begin; z < end; ++z) {
      const auto index = static_cast<openvdb::Index>(edge * column + z);
      if (node.isChildMaskOn(index)) {
        on_child(*node.getTable()[index].getChild());
      } else {
        on_tile(index);
      }
    }
  }
}

/// Copies the part of a tree that lies in `range` into another one that has nothing there yet.
template <typename TreeT>
class LayerCopy {
 public:
  using Value = typename TreeT::ValueType;
  using Leaf = typename TreeT::LeafNodeType;

  LayerCopy(const TreeT& source, TreeT& target, ZRange range)
      : source_(source), target_(target), accessor_(target), range_(range) {}

  void run() {
    const auto& root = source_.root();
    for (auto tile = root.cbeginValueAll(); tile; ++tile) {
      if (tile.isValueOn() || tile.getValue() != target_.background())
        fill(tile.getCoord(), root.getLevel(), tile.getValue(), tile.isValueOn());
    }
    for (auto child = root.cbeginChildOn(); child; ++child) copyNode(*child);
    copyLeaves();
  }

 private:
  template <typename Node>
  void copyNode(const Node& node) {
    const auto copy_tile = [&](openvdb::Index index) {
      const Value value = node.getTable()[index].getValue();
      const bool active = node.isValueMaskOn(index);
      if (active || value != target_.background())
        fill(node.offsetToGlobalCoord(index), Node::LEVEL, value, active);
    };
    forEachEntry(node, range_, copy_tile, [&](const auto& child) {
      if constexpr (Node::LEVEL == 1) {
        leaves_.push_back(&child);
      } else {
        copyNode(child);
      }
    });
  }

  /// Fills what `range_` has of the tile at `origin`, as few and as large tiles as can be.
  void fill(const Coord& origin, int level, const Value& value, bool active) {
    static constexpr std::array<int, 4> edges{1, Leaf::DIM, 16 * Leaf::DIM, 32 * 16 * Leaf::DIM};
    const int edge = edges[level];
    const ZRange layers{origin.z(), origin.z() + edge};
    if (intersection(layers, range_).empty()) return;
    if (within(layers, range_)) {
      accessor_.addTile(level, origin, value, active);
    } else if (level == 1) {
      auto leaf = std::make_unique<Leaf>(origin, value, active);
      cut(*leaf);
      accessor_.addLeaf(leaf.release());
    } else {
      const int step = edges[level - 1];
      for (int x = 0; x < edge; x += step) {
        for (int y = 0; y < edge; y += step) {
          for (int z = 0; z < edge; z += step)
            fill(origin.offsetBy(x, y, z), level - 1, value, active);
        }
      }
    }
  }

  /// Makes background of the layers outside `range_`.
  void cut(Leaf& leaf) const {
    const int bottom = leaf.origin().z();
    const int begin = std::clamp(range_.begin - bottom, 0, leaf_layers);
    const int end = std::clamp(range_.end - bottom, begin, leaf_layers);
    const auto makeBackground = [&](const auto& set) {
      for (int row = 0; row < static_cast<int>(Leaf::SIZE); row += leaf_layers) {
        for (int n = row; n < row + begin; ++n) set(static_cast<openvdb::Index>(n));
        for (int n = row + end; n < row + leaf_layers; ++n) set(static_cast<openvdb::Index>(n));
      }
    };
    const Value background = target_.background();
    openvdb::util::NodeMask<Leaf::LOG2DIM> active = leaf.getValueMask();
    const std::uint64_t kept = 0x0101010101010101U * ((1U << end) - (1U << begin));
    for (openvdb::Index x = 0; x < 8; ++x) active.template getWord<std::uint64_t>(x) &= kept;
    leaf.setValueMask(active);
    if constexpr (std::is_same_v<decltype(leaf.buffer().data()), Value*>) {
      Value* values = leaf.buffer().data();
      makeBackground([&](openvdb::Index n) { values[n] = background; });
    } else {
      makeBackground([&](openvdb::Index n) { leaf.setValueOff(n, background); });
    }
  }

  [[nodiscard]] std::unique_ptr<Leaf> copyOf(const Leaf& leaf) const {
    auto copy = std::make_unique<Leaf>(leaf);
    if (!within(layersOf(leaf.getNodeBoundingBox()), range_)) {
      cut(*copy);
      if (copy->isEmpty() && allBackground(*copy)) return nullptr;
    }
    return copy;
  }

  void copyLeaves() {
    std::vector<std::unique_ptr<Leaf>> copies(leaves_.size());
    tbb::parallel_for(std::size_t{0}, leaves_.size(),
                      [&](std::size_t n) { copies[n] = copyOf(*leaves_[n]); });
    for (auto& copy : copies)
      if (copy) accessor_.addLeaf(copy.release());
  }

  bool allBackground(const Leaf& leaf) const {
    Value value;
    bool active = false;
    return leaf.isConstant(value, active) && !active && value == target_.background();
  }

  const TreeT& source_;
  TreeT& target_;
  openvdb::tree::ValueAccessor<TreeT, false> accessor_;
  ZRange range_;
  std::vector<const Leaf*> leaves_;  ///< those in the range
};

/// Copies the layers of all `pieces` within `wanted` into a grid of their type that has nothing
/// there yet.
template <typename GridT>
void copyLayers(std::span<const GridLayers> pieces, ZRange wanted, GridT& target) {
  for (const GridLayers& piece : pieces) {
    const ZRange range = intersection(piece.range, wanted);
    if (!range.empty())
      LayerCopy(static_cast<const GridT&>(*piece.grid).tree(), target.tree(), range).run();
  }
}

/// Returns whether an internal node has only background outside `range`.
template <typename Node, typename Value>
bool endsWithin(const Node& node, ZRange range, const Value& background) {
  bool ends = true;
  const ZRange layers = layersOf(node.getNodeBoundingBox());
  for (const ZRange outside : {ZRange{layers.begin, range.begin}, ZRange{range.end, layers.end}}) {
    if (outside.empty()) continue;
    const auto look_at_tile = [&](openvdb::Index index) {
      ends &= !node.isValueMaskOn(index) && node.getTable()[index].getValue() == background;
    };
    forEachEntry(node, outside, look_at_tile, [&]([[maybe_unused]] const auto& child) {
      if constexpr (Node::LEVEL == 1) {
        ends = false;
      } else {
        ends &= endsWithin(child, range, background);
      }
    });
  }
  return ends;
}

/// The same of a tree.
template <typename Tree>
bool endsWithin(const Tree& tree, ZRange range) {
  for (auto tile = tree.root().cbeginValueAll(); tile; ++tile) {
    if (tile.isValueOn() || tile.getValue() != tree.background()) return false;
  }
  for (auto child = tree.root().cbeginChildOn(); child; ++child) {
    if (!endsWithin(*child, range, tree.background())) return false;
  }
  return true;
}

}  // namespace

GridConstPtr joinLayers(std::span<const GridLayers> pieces, ZRange wanted) {
  if (pieces.size() == 1 && within(pieces.front().range, wanted)) return pieces.front().grid;
  GridConstPtr result;
  visitGrid(*pieces.front().grid, [&](const auto& first) {
    using GridT = std::decay_t<decltype(first)>;
    const auto joined = openvdb::gridPtrCast<GridT>(first.copyGridWithNewTree());
    copyLayers(pieces, wanted, *joined);
    result = joined;
  });
  return result;
}

bool addLayers(GridBase& grid, ZRange own, std::span<const GridLayers> pieces, ZRange wanted) {
  bool could = true;
  visitGrid(grid, [&](const auto& typed) {
    using GridT = std::decay_t<decltype(typed)>;
    could = endsWithin(typed.tree(), alignedToLeaves(own));
    if (could) copyLayers(pieces, wanted, static_cast<GridT&>(grid));
  });
  return could;
}

GridConstPtr pruned(const GridConstPtr& grid) {
  const GridBase::Ptr copy = grid->deepCopyGrid();
  visitGrid(*copy, [&](const auto& typed) {
    using GridT = std::decay_t<decltype(typed)>;
    openvdb::tools::prune(openvdb::gridPtrCast<GridT>(copy)->tree());
  });
  return copy;
}

GridSize sizeOf(const GridConstPtr& grid) {
  return {static_cast<double>(grid->memUsage()), static_cast<double>(grid->activeVoxelCount())};
}

double leafBytes(const GridConstPtr& grid) {
  constexpr double overhead_bytes = 128;
  const std::string type = grid->valueType();
  if (type == "bool" || type == "mask") return 64 + overhead_bytes;
  const double component = type.ends_with("d") || type == "int64" || type == "double" ? 8 : 4;
  return 512 * component * (type.starts_with("vec3") ? 3 : 1) + overhead_bytes;
}

}  // namespace vdbdither
