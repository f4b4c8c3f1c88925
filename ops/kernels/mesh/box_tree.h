#pragma once

#include <cstdint>
#include <vector>

#include <openvdb/Types.h>
#include <openvdb/math/BBox.h>

namespace vdbdither {

/// A balanced tree over some of the boxes in a vector, which must outlive it.
class BoxTree {
 public:
  using Box = openvdb::math::BBox<openvdb::Vec3d>;

  BoxTree() = default;
  /// The tree over the boxes with the indices `of`. The order of visits depends on them alone.
  BoxTree(const std::vector<Box>& boxes, std::vector<std::uint32_t> of);

  /// Calls visit(index) for each box for which reaches(box) is true, until visit returns false.
  /// `reaches` must hold for a box that contains one for which it holds. Returns whether all visits
  /// returned true.
  template <class Reaches, class Visit>
  bool visit(const Reaches& reaches, const Visit& visit) const {
    std::uint32_t node = 0;
    while (node < nodes_.size()) {
      const Node& own = nodes_[node];
      if (!reaches(own.box)) {
        node = own.next;
        continue;
      }
      for (std::uint32_t i = own.begin; i < own.end; ++i)
        if (reaches((*boxes_)[order_[i]]) && !visit(order_[i])) return false;
      ++node;
    }
    return true;
  }

 private:
  /// Nodes are in the order of a walk that visits the first half before the second.
  struct Node {
    Box box;
    std::uint32_t begin = 0, end = 0;  ///< of a leaf, in `order_`
    std::uint32_t next = 0;            ///< the node after all those below
  };

  void build(std::uint32_t begin, std::uint32_t end);

  const std::vector<Box>* boxes_ = nullptr;
  std::vector<std::uint32_t> order_;
  std::vector<Node> nodes_;
};

}  // namespace vdbdither
