#pragma once

#include <memory>

#include <openvdb/Types.h>
#include <openvdb/math/Coord.h>

#include "vdbdither/model/lattice.h"

namespace vdbdither {

/// Returns an inactive leaf with its buffer allocated. The caller must set every voxel: they are
/// not initialized.
template <class Tree>
typename Tree::LeafNodeType* newLeaf(const openvdb::Coord& origin) {
  auto* leaf = new typename Tree::LeafNodeType(openvdb::PartialCreate(), origin);
  leaf->allocate();
  return leaf;
}

/// Adjacent leaves along x, the first at `origin`.
struct LeafSpan {
  openvdb::Coord origin;
  int leaves;
};

/// Adds leaves and tiles to the nodes above the leaves, which must exist. Several threads can write
/// at once to different nodes.
template <class Tree>
class NodeWriter {
 public:
  using Parent = typename Tree::RootNodeType::ChildNodeType::ChildNodeType;

  static openvdb::Coord parentOf(const openvdb::Coord& xyz) {
    return xyz & ~(static_cast<int>(Parent::DIM) - 1);
  }

  /// Makes the node above the leaf at `origin`, if there is none.
  static void makeParent(Tree& tree, const openvdb::Coord& origin) {
    if (!tree.template probeConstNode<Parent>(origin))
      tree.addTile(1, origin, tree.background(), false);
  }

  explicit NodeWriter(Tree& tree) : tree_(tree) {}

  void set(std::unique_ptr<typename Tree::LeafNodeType> leaf) {
    Parent& parent = parentAt(leaf->origin());
    parent.addLeaf(leaf.release());
  }

  void set(const LeafSpan& span, const typename Tree::ValueType& value) {
    for (int leaf = 0; leaf < span.leaves; ++leaf) {
      const openvdb::Coord origin = span.origin.offsetBy(leaf * leaf_layers, 0, 0);
      parentAt(origin).addTile(Parent::coordToOffset(origin), value, false);
    }
  }

 private:
  Parent& parentAt(const openvdb::Coord& xyz) {
    if (!parent_ || parent_->origin() != parentOf(xyz))
      parent_ = tree_.template probeNode<Parent>(xyz);
    return *parent_;
  }

  Tree& tree_;
  Parent* parent_ = nullptr;
};

}  // namespace vdbdither
