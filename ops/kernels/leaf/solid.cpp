#include "ops/kernels/leaf/solid.h"

#include <algorithm>

#include <openvdb/tools/Prune.h>

#include "vdbdither/model/known_grids.h"

namespace vdbdither {

using openvdb::Coord;
using openvdb::CoordBBox;

namespace {

/// Appends the inside tiles in the tables of all nodes of one kind. Looks only at entries that meet
/// `layers`, and joins tiles on top of each other to one box.
template <typename Node>
void addInsideTiles(const openvdb::FloatTree& surface, ZRange layers,
                    std::vector<CoordBBox>& boxes) {
  constexpr int edge = 1 << Node::LOG2DIM;
  constexpr int tile = Node::ChildNodeType::DIM;
  std::vector<const Node*> nodes;
  surface.getNodes(nodes);
  for (const Node* node : nodes) {
    const int bottom = node->origin().z();
    const int begin = std::max(0, (layers.begin - bottom) / tile);
    const int end = std::min(edge, (layers.end - bottom + tile - 1) / tile);
    for (int row = 0; row < edge * edge; ++row) {
      const auto inside = [&](int z) {
        const auto n = static_cast<openvdb::Index>(edge * row + z);
        return !node->isChildMaskOn(n) && node->getTable()[n].getValue() < 0.0F;
      };
      for (int z = begin; z < end; ++z) {
        if (!inside(z)) continue;
        const int first = z;
        while (z + 1 < end && inside(z + 1)) ++z;
        const Coord corner = node->offsetToGlobalCoord(static_cast<openvdb::Index>(edge * row));
        boxes.emplace_back(corner.offsetBy(0, 0, first * tile),
                           corner.offsetBy(tile - 1, tile - 1, (z + 1) * tile - 1));
      }
    }
  }
}

}  // namespace

std::vector<CoordBBox> insideTiles(const openvdb::FloatTree& surface, ZRange layers) {
  using Upper = openvdb::FloatTree::RootNodeType::ChildNodeType;
  std::vector<CoordBBox> boxes;
  addInsideTiles<Upper::ChildNodeType>(surface, layers, boxes);
  addInsideTiles<Upper>(surface, layers, boxes);
  for (auto tile = surface.root().cbeginValueAll(); tile; ++tile) {
    if (*tile < 0.0F) boxes.push_back(CoordBBox::createCube(tile.getCoord(), Upper::DIM));
  }
  for (CoordBBox& box : boxes) {
    box.min().z() = std::max(box.min().z(), layers.begin);
    box.max().z() = std::min(box.max().z(), layers.end - 1);
  }
  std::erase_if(boxes, [](const CoordBBox& box) { return box.empty(); });
  return boxes;
}

openvdb::BoolGrid::Ptr makeSolidGrid(const openvdb::math::Transform& transform) {
  auto grid = openvdb::BoolGrid::create(false);
  grid->setName(solid_grid);
  grid->setTransform(transform.copy());
  return grid;
}

openvdb::Int32Grid::Ptr makeMaterialGrid(const openvdb::math::Transform& transform) {
  auto grid = openvdb::Int32Grid::create(0);
  grid->setName(material_grid);
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
