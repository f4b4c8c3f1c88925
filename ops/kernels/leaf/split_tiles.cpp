#include "ops/kernels/leaf/split_tiles.h"

#include <memory>

#include <openvdb/tree/NodeManager.h>

namespace vdbdither {

using openvdb::Int32Tree;

namespace {

/// Sets every active voxel of a copied topology to one value. OpenVDB's own copy with two values
/// tests each voxel of each leaf.
struct SetActives {
  std::int32_t on;

  template <typename Node>
  void operator()(Node& node) const {
    for (auto value = node.beginValueOn(); value; ++value) value.setValue(on);
  }
  void operator()(Int32Tree::LeafNodeType& leaf) const {
    std::int32_t* values = leaf.buffer().data();
    for (openvdb::Index x = 0; x < 8; ++x) {
      const std::uint64_t word = leaf.getValueMask().getWord<std::uint64_t>(x);
      for (unsigned n = 0; n < 64; ++n) *values++ = static_cast<std::int32_t>(word >> n & 1U) * on;
    }
  }
};

}  // namespace

Int32Tree::Ptr valueWhereActive(const openvdb::BoolTree& solid, std::int32_t value) {
  auto tree = std::make_shared<Int32Tree>(solid, 0, openvdb::TopologyCopy());
  openvdb::tree::NodeManager<Int32Tree> nodes(*tree);
  nodes.foreachTopDown(SetActives{value});
  return tree;
}

}  // namespace vdbdither
