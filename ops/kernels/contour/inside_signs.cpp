#include "ops/kernels/contour/inside_signs.h"

#include <algorithm>
#include <array>
#include <vector>

#include <openvdb/tools/SignedFloodFill.h>
#include <tbb/blocked_range.h>
#include <tbb/parallel_reduce.h>

namespace vdbdither {

using openvdb::Coord;
using openvdb::FloatGrid;
using openvdb::FloatTree;
using Leaf = FloatTree::LeafNodeType;
using Accessor = openvdb::tree::ValueAccessor<const FloatTree>;

namespace {

constexpr std::array<std::array<int, 3>, 6> faces{
    {{-1, 0, 0}, {1, 0, 0}, {0, -1, 0}, {0, 1, 0}, {0, 0, -1}, {0, 0, 1}}};

struct Voxel {
  float value = 0;
  bool active = false;
};

/// The voxels of a leaf and those beside it.
class Around {
 public:
  Around(const Leaf& leaf, const Accessor& beyond) : leaf_(leaf), beyond_(beyond) {}

  [[nodiscard]] Voxel at(const Coord& ijk) const {
    Voxel voxel;
    if ((ijk & ~(static_cast<int>(Leaf::DIM) - 1)) == leaf_.origin()) {
      const openvdb::Index offset = Leaf::coordToOffset(ijk);
      voxel.active = leaf_.isValueOn(offset);
      voxel.value = leaf_.getValue(offset);
    } else {
      voxel.active = beyond_.probeValue(ijk, voxel.value);
    }
    return voxel;
  }

 private:
  const Leaf& leaf_;
  const Accessor& beyond_;
};

/// A negative voxel of the band that touches one beyond it that is not negative.
bool lacksInside(const Voxel& a, const Voxel& b) {
  return a.active && a.value < 0 && !b.active && !(b.value < 0);
}

/// Neighbours of opposite sign that are not both in the band.
bool isOpen(const Voxel& a, const Voxel& b) {
  return (a.value < 0) != (b.value < 0) && !(a.active && b.active);
}

/// The first voxel in the order of the leaves with a neighbour for which `wrong` returns true.
template <typename Wrong>
std::optional<Coord> firstWrong(const FloatTree& tree, const Wrong& wrong) {
  std::vector<const Leaf*> leaves;
  tree.getNodes(leaves);
  const auto wrongIn = [&](const Leaf& leaf, const Accessor& beyond) -> std::optional<Coord> {
    const Around around(leaf, beyond);
    for (auto value = leaf.cbeginValueAll(); value; ++value) {
      const Voxel voxel{*value, value.isValueOn()};
      const Coord ijk = value.getCoord();
      for (const auto& [x, y, z] : faces) {
        if (wrong(voxel, around.at(ijk.offsetBy(x, y, z)))) return ijk;
      }
    }
    return std::nullopt;
  };
  const std::size_t first = tbb::parallel_reduce(
      tbb::blocked_range<std::size_t>(0, leaves.size(), 16), leaves.size(),
      [&](const auto& range, std::size_t found) {
        const Accessor beyond(tree);
        for (std::size_t n = range.begin(); n < std::min(found, range.end()); ++n) {
          if (wrongIn(*leaves[n], beyond)) return n;
        }
        return found;
      },
      [](std::size_t a, std::size_t b) { return std::min(a, b); });
  if (first == leaves.size()) return std::nullopt;
  return wrongIn(*leaves[first], Accessor(tree));
}

/// The first tile that touches one of opposite sign, with no band between them.
std::optional<Coord> firstOpenTile(const FloatTree& tree) {
  const Accessor values(tree);
  auto tile = tree.cbeginValueOff();
  tile.setMaxDepth(FloatTree::ValueOffCIter::LEAF_DEPTH - 1);
  for (; tile; ++tile) {
    openvdb::CoordBBox box;
    tile.getBoundingBox(box);
    const Voxel voxel{*tile, false};
    const Coord middle(box.min().x() + (box.dim().x() >> 1), box.min().y() + (box.dim().y() >> 1),
                       box.min().z() + (box.dim().z() >> 1));
    for (std::size_t face = 0; face < faces.size(); ++face) {
      Coord beside = middle;
      const auto axis = face / 2;
      beside[axis] = face % 2 == 0 ? box.min()[axis] - 1 : box.max()[axis] + 1;
      Voxel other;
      other.active = values.probeValue(beside, other.value);
      if (isOpen(voxel, other)) return box.min();
    }
  }
  return std::nullopt;
}

bool hasNegativeBeyondBand(const FloatTree& tree) {
  auto value = tree.cbeginValueOff();
  for (; value; ++value) {
    if (*value < 0) return true;
  }
  return false;
}

}  // namespace

SignedLevelSet withInsideSigns(const FloatGrid::ConstPtr& grid) {
  const std::optional<Coord> lacking = firstWrong(grid->tree(), lacksInside);
  if (!lacking) return {grid, InsideSigns::given, {}};
  const FloatGrid::Ptr filled = grid->deepCopy();
  openvdb::tools::signedFloodFill(filled->tree());
  std::optional<Coord> open = firstWrong(filled->tree(), isOpen);
  if (!open) open = firstOpenTile(filled->tree());
  if (!open) return {filled, InsideSigns::filled, {}};
  if (hasNegativeBeyondBand(grid->tree())) return {grid, InsideSigns::given, {}};
  return {grid, InsideSigns::missing, *open};
}

}  // namespace vdbdither
