#include "ops/kernels/leaf/node_writer.h"

#include <utility>

#include <gtest/gtest.h>

#include "vdbdither/model/openvdb.h"

namespace vdbdither {
namespace {

using openvdb::Coord;
using openvdb::FloatTree;
using Writer = NodeWriter<FloatTree>;

TEST(NodeWriter, AddsLeavesAndSpansOfTilesAcrossNodes) {
  FloatTree tree(1.0F);
  for (const Coord& origin : {Coord(-8, 0, 0), Coord(0, 0, 0)}) Writer::makeParent(tree, origin);
  Writer writer(tree);
  std::unique_ptr<FloatTree::LeafNodeType> leaf(newLeaf<FloatTree>({8, 0, 0}));
  leaf->fill(0.25F, false);
  leaf->setValueOn(Coord(9, 1, 2), 0.5F);
  writer.set(std::move(leaf));
  writer.set({{-16, 0, 0}, 3}, -1.0F);
  EXPECT_EQ(tree.leafCount(), 1U);
  EXPECT_EQ(tree.activeVoxelCount(), 1U);
  EXPECT_EQ(tree.getValue({9, 1, 2}), 0.5F);
  EXPECT_EQ(tree.getValue({8, 1, 2}), 0.25F);
  for (const int x : {-16, -1, 0, 7}) EXPECT_EQ(tree.getValue({x, 3, 3}), -1.0F) << x;
  for (const int x : {-17, 16}) EXPECT_EQ(tree.getValue({x, 3, 3}), 1.0F) << x;
}

TEST(NodeWriter, KeepsANodeThatExists) {
  FloatTree tree(1.0F);
  tree.setValueOn({0, 0, 0}, 0.5F);
  Writer::makeParent(tree, {8, 0, 0});
  EXPECT_EQ(tree.getValue({0, 0, 0}), 0.5F);
}

}  // namespace
}  // namespace vdbdither
