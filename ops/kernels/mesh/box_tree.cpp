#include "ops/kernels/mesh/box_tree.h"

#include <algorithm>
#include <utility>

namespace vdbdither {

namespace {

constexpr std::uint32_t boxes_per_leaf = 4;

}  // namespace

BoxTree::BoxTree(const std::vector<Box>& boxes, std::vector<std::uint32_t> of)
    : boxes_(&boxes), order_(std::move(of)) {
  nodes_.reserve(order_.size());
  if (!order_.empty()) build(0, static_cast<std::uint32_t>(order_.size()));
}

void BoxTree::build(std::uint32_t begin, std::uint32_t end) {
  const std::vector<Box>& boxes = *boxes_;
  const std::size_t index = nodes_.size();
  nodes_.emplace_back();
  Box whole;
  Box middles;
  for (std::uint32_t i = begin; i < end; ++i) {
    whole.expand(boxes[order_[i]]);
    middles.expand(boxes[order_[i]].getCenter());
  }
  nodes_[index].box = whole;
  if (end - begin <= boxes_per_leaf) {
    nodes_[index].begin = begin;
    nodes_[index].end = end;
  } else {
    const auto axis = static_cast<int>(middles.maxExtent());
    const auto key = [&](std::uint32_t i) { return boxes[i].min()[axis] + boxes[i].max()[axis]; };
    const std::uint32_t half = begin + (end - begin) / 2;
    std::nth_element(order_.begin() + begin, order_.begin() + half, order_.begin() + end,
                     [&](std::uint32_t a, std::uint32_t b) {
                       return std::pair(key(a), a) < std::pair(key(b), b);
                     });
    build(begin, half);
    build(half, end);
  }
  nodes_[index].next = static_cast<std::uint32_t>(nodes_.size());
}

}  // namespace vdbdither
