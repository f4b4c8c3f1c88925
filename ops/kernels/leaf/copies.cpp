#include "ops/kernels/leaf/copies.h"

#include "vdbdither/model/interrupt.h"
#include "vdbdither/model/openvdb.h"
#include "vdbdither/model/visit_grid.h"

namespace vdbdither {

namespace {

template <class TreeT>
void addCopy(const TreeT& from, const openvdb::Coord& offset, TreeT& to) {
  using LeafT = typename TreeT::LeafNodeType;
  for (auto leaf = from.cbeginLeaf(); leaf; ++leaf) {
    auto copy = std::make_unique<LeafT>(*leaf);
    copy->setOrigin(leaf->origin() + offset);
    to.addLeaf(copy.release());
  }
  auto tile = from.cbeginValueAll();
  tile.setMaxDepth(TreeT::ValueAllCIter::LEAF_DEPTH - 1);
  for (; tile; ++tile) {
    if (!tile.isValueOn() && tile.getValue() == from.background()) continue;
    openvdb::CoordBBox box;
    tile.getBoundingBox(box);
    box.translate(offset);
    to.sparseFill(box, tile.getValue(), tile.isValueOn());
  }
}

}  // namespace

GridConstPtr copiesAt(const GridConstPtr& grid, std::span<const openvdb::Coord> offsets) {
  GridConstPtr result;
  visitGrid(*grid, [&](const auto& typed) {
    using GridT = std::decay_t<decltype(typed)>;
    const auto copies = openvdb::gridPtrCast<GridT>(typed.copyGridWithNewTree());
    for (const openvdb::Coord& offset : offsets) {
      throwIfInterrupted();
      addCopy(typed.tree(), offset, copies->tree());
    }
    result = copies;
  });
  return result;
}

}  // namespace vdbdither
