#include "io/stack/colour_grids.h"

#include <array>
#include <cstdint>
#include <memory>

#include <openvdb/tools/Prune.h>
#include <openvdb/tree/LeafManager.h>

#include "io/image/srgb.h"

namespace vdbdither {

namespace {

template <typename Tree, typename Meaning>
typename Tree::Ptr translated(const openvdb::Int32Tree& encoded, const Meaning& meaning) {
  auto tree =
      std::make_shared<Tree>(encoded, typename Tree::ValueType(0.0F), openvdb::TopologyCopy());
  auto tile = tree->beginValueOn();
  tile.setMaxDepth(Tree::ValueOnIter::LEAF_DEPTH - 1);
  for (; tile; ++tile) tile.setValue(meaning(encoded.getValue(tile.getCoord())));
  openvdb::tree::LeafManager<Tree> leaves(*tree);
  leaves.foreach ([&](typename Tree::LeafNodeType& leaf, std::size_t) {
    const auto* from = encoded.probeConstLeaf(leaf.origin());
    for (auto voxel = leaf.beginValueOn(); voxel; ++voxel)
      voxel.setValue(meaning(from->getValue(voxel.pos())));
  });
  openvdb::tools::prune(*tree);
  return tree;
}

}  // namespace

openvdb::Vec3STree::Ptr linearColours(const openvdb::Int32Tree& encoded) {
  const std::array<float, 256>& linear = linearOfSrgbBytes();
  return translated<openvdb::Vec3STree>(encoded, [&](std::int32_t value) {
    const auto colour = static_cast<std::uint32_t>(value);
    return openvdb::Vec3s(linear[colour & 255], linear[colour >> 8 & 255],
                          linear[colour >> 16 & 255]);
  });
}

openvdb::FloatTree::Ptr opacities(const openvdb::Int32Tree& encoded) {
  return translated<openvdb::FloatTree>(encoded, [](std::int32_t value) {
    return static_cast<float>(static_cast<std::uint32_t>(value) >> 24) / 255;
  });
}

}  // namespace vdbdither
