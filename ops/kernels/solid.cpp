#include "ops/kernels/solid.h"

#include <algorithm>

#include <openvdb/tools/Prune.h>

namespace vdbdither {

using openvdb::Coord;
using openvdb::CoordBBox;

std::vector<CoordBBox> insideTiles(const openvdb::FloatTree& surface, ZRange layers) {
  std::vector<CoordBBox> boxes;
  const auto keep = [&](CoordBBox box) {
    box.min().z() = std::max(box.min().z(), layers.begin);
    box.max().z() = std::min(box.max().z(), layers.end - 1);
    if (!box.empty()) boxes.push_back(box);
  };

  // Tiles of 8³, where nearly all are: only the layers asked for, not the whole node of 128³.
  using Node = openvdb::FloatTree::RootNodeType::ChildNodeType::ChildNodeType;
  std::vector<const Node*> nodes;
  surface.getNodes(nodes);
  for (const Node* node : nodes) {
    const int first = std::clamp((layers.begin - node->origin().z()) >> 3, 0, 16);
    const int last = std::clamp((layers.end - 1 - node->origin().z()) >> 3, -1, 15);
    for (int row = 0; row < 256; ++row) {
      for (int z = first; z <= last; ++z) {
        const auto n = static_cast<openvdb::Index>(16 * row + z);
        if (node->isChildMaskOn(n) || !(node->getTable()[n].getValue() < 0.0F)) continue;
        keep(CoordBBox::createCube(node->offsetToGlobalCoord(n), 8));
      }
    }
  }

  auto tile = surface.cbeginValueAll();
  tile.setMaxDepth(openvdb::FloatTree::ValueAllCIter::LEAF_DEPTH - 2);
  for (; tile; ++tile) {
    if (*tile < 0.0F) keep(tile.getBoundingBox());
  }
  return boxes;
}

openvdb::BoolGrid::Ptr makeSolidGrid(const openvdb::math::Transform& transform) {
  auto grid = openvdb::BoolGrid::create(false);
  grid->setName("solid");
  grid->setTransform(transform.copy());
  return grid;
}

openvdb::BoolGrid::Ptr makeSolidGrid(const openvdb::math::Transform& transform,
                                     std::span<const SolidLeaf> leaves,
                                     std::span<const CoordBBox> boxes) {
  using Leaf = openvdb::BoolTree::LeafNodeType;
  auto grid = makeSolidGrid(transform);
  for (const CoordBBox& box : boxes) grid->tree().sparseFill(box, true);
  for (const SolidLeaf& leaf : leaves) {
    if (leaf.inside == no_bits) continue;
    openvdb::util::NodeMask<3> mask;
    for (unsigned x = 0; x < 8; ++x) mask.getWord<std::uint64_t>(x) = leaf.inside[x];
    auto made = std::make_unique<Leaf>(leaf.origin);
    made->setValueMask(mask);
    Leaf::Buffer values(mask);
    made->swap(values);
    grid->tree().addLeaf(made.release());
  }
  openvdb::tools::prune(grid->tree());
  return grid;
}

}  // namespace vdbdither
