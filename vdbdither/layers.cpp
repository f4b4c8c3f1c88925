#include "vdbdither/layers.h"

#include <algorithm>
#include <array>
#include <memory>

#include <openvdb/tools/Prune.h>

#include "vdbdither/openvdb.h"
#include "vdbdither/visit_grid.h"

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
        copyLeaf(child);
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
    for (openvdb::Index offset = 0; offset < Leaf::SIZE; ++offset) {
      if (!range_.contains(leaf.offsetToGlobalCoord(offset).z()))
        leaf.setValueOff(offset, target_.background());
    }
  }

  void copyLeaf(const Leaf& leaf) {
    const ZRange layers = layersOf(leaf.getNodeBoundingBox());
    if (intersection(layers, range_).empty()) return;
    auto copy = std::make_unique<Leaf>(leaf);
    if (!within(layers, range_)) {
      cut(*copy);
      if (copy->isEmpty() && allBackground(*copy)) return;
    }
    accessor_.addLeaf(copy.release());
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
};

/// Copies the layers of all `pieces` within `wanted` into a grid of their type that has nothing
/// there yet.
template <typename GridT>
void copyLayers(std::span<const Layers> pieces, ZRange wanted, GridT& target) {
  for (const Layers& piece : pieces) {
    const ZRange range = intersection(piece.range, wanted);
    if (!range.empty())
      LayerCopy(static_cast<const GridT&>(*piece.grid).tree(), target.tree(), range).run();
  }
}

/// Whether an internal node has nothing but background outside `range`.
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

GridConstPtr joinLayers(std::span<const Layers> pieces, ZRange wanted) {
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

bool addLayers(GridBase& grid, ZRange own, std::span<const Layers> pieces, ZRange wanted) {
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
