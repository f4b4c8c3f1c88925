#include "ops/kernels/mesh/box_tree.h"

#include <algorithm>
#include <random>

#include <gtest/gtest.h>

namespace vdbdither {
namespace {

using openvdb::Vec3d;

std::vector<BoxTree::Box> randomBoxes(std::size_t count) {
  std::mt19937 random(2);
  std::uniform_real_distribution<double> place(0, 10);
  std::uniform_real_distribution<double> size(0, 1);
  std::vector<BoxTree::Box> boxes;
  for (std::size_t i = 0; i < count; ++i) {
    const Vec3d low(place(random), place(random), place(random));
    boxes.emplace_back(low, low + Vec3d(size(random), size(random), size(random)));
  }
  return boxes;
}

TEST(BoxTree, VisitsTheBoxesReachedOnceEach) {
  const std::vector<BoxTree::Box> boxes = randomBoxes(500);
  std::vector<std::uint32_t> even;
  for (std::uint32_t i = 0; i < boxes.size(); i += 2) even.push_back(i);
  const BoxTree tree(boxes, even);
  std::size_t total = 0;
  for (const BoxTree::Box& around : boxes) {
    const auto reaches = [&](const BoxTree::Box& box) { return around.hasOverlap(box); };
    std::vector<std::uint32_t> expected;
    std::copy_if(even.begin(), even.end(), std::back_inserter(expected),
                 [&](std::uint32_t i) { return reaches(boxes[i]); });
    std::vector<std::uint32_t> visited;
    EXPECT_TRUE(tree.visit(reaches, [&](std::uint32_t i) {
      visited.push_back(i);
      return true;
    }));
    std::sort(visited.begin(), visited.end());
    EXPECT_EQ(visited, expected);
    total += visited.size();
  }
  EXPECT_GT(total, even.size());
}

TEST(BoxTree, StopsWhereTheVisitorAsks) {
  const std::vector<BoxTree::Box> boxes = randomBoxes(20);
  const BoxTree tree(boxes, {0, 3, 4, 5, 6, 7, 8, 19});
  int visits = 0;
  EXPECT_FALSE(tree.visit([](const BoxTree::Box&) { return true; },
                          [&](std::uint32_t) { return ++visits < 3; }));
  EXPECT_EQ(visits, 3);
}

TEST(BoxTree, ATreeOfNoBoxesVisitsNone) {
  const std::vector<BoxTree::Box> none;
  const auto fail = [](std::uint32_t) { return false; };
  EXPECT_TRUE(BoxTree(none, {}).visit([](const BoxTree::Box&) { return true; }, fail));
  EXPECT_TRUE(BoxTree().visit([](const BoxTree::Box&) { return true; }, fail));
}

}  // namespace
}  // namespace vdbdither
