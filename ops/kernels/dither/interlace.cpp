// Eq. (11) of Morsy, Brunton, Urban: Shape Dithering for 3D Printing, ACM Transactions on
// Graphics 41(4), 2022.

#include "ops/kernels/dither/interlace.h"

#include <algorithm>
#include <vector>

#include <tbb/parallel_for.h>

#include "ops/kernels/leaf/leaf_bits.h"
#include "ops/kernels/leaf/leaf_origins.h"
#include "ops/kernels/leaf/solid.h"

namespace vdbdither {

using openvdb::Coord;
using openvdb::CoordBBox;
using openvdb::FloatTree;

namespace {

using Accessor = openvdb::tree::ValueAccessor<const FloatTree, false>;

/// Returns V among the 8³ voxels at `origin`, which are a leaf or part of a tile.
LeafBits insideBitsAt(Accessor& surface, const Coord& origin, ZRange layers) {
  const std::uint8_t row = rowWithin(origin.z(), layers);
  if (const FloatLeaf* leaf = surface.probeConstLeaf(origin)) return insideBits(*leaf, row);
  LeafBits bits;
  bits.fill(surface.getValue(origin) < 0.0F ? everyRow(row) : 0);
  return bits;
}

/// Returns four rows of the plain lattice from eight refined ones: the even rows on even slices,
/// the odd rows on odd slices.
std::uint32_t pickedRows(std::uint64_t refined) {
  std::uint32_t picked = 0;
  for (unsigned j = 0; j < 4; ++j) {
    const std::uint64_t even = (refined >> (16 * j)) & 0x55U;
    const std::uint64_t odd = (refined >> (16 * j + 8)) & 0xaaU;
    picked |= static_cast<std::uint32_t>(even | odd) << (8 * j);
  }
  return picked;
}

/// Returns the plain leaf that holds a refined one; two refined leaves along y share one.
Coord plainOrigin(const Coord& refined) {
  return {refined.x(), (refined.y() >> 4) * leaf_layers, refined.z()};
}

/// The inside tiles of the refined lattice, on the plain one.
struct PlainTiles {
  std::vector<CoordBBox> whole;
  std::vector<Coord> leaves;  ///< origins of leaves of which only one half is an inside tile
};

PlainTiles plainTiles(const FloatTree& refined, ZRange core) {
  PlainTiles plain;
  Accessor surface(refined);
  const auto isInsideTile = [&](const Coord& origin) {
    return !surface.probeConstLeaf(origin) && surface.getValue(origin) < 0.0F;
  };
  for (CoordBBox box : insideTiles(refined, core)) {
    const Coord first(box.min().x(), box.min().y(), box.min().z() & ~(leaf_layers - 1));
    const bool is_lower = (first.y() & leaf_layers) == 0;
    const bool is_pair = box.dim().y() > leaf_layers;
    box.min().y() = plainOrigin(first).y();
    box.max().y() = is_pair ? box.max().y() >> 1 : box.min().y() + leaf_layers - 1;
    if (is_pair) {
      plain.whole.push_back(box);
      continue;
    }
    bool goes_on = false;
    for (Coord leaf = first; leaf.z() <= box.max().z(); leaf.z() += leaf_layers) {
      if (!isInsideTile(leaf.offsetBy(0, is_lower ? leaf_layers : -leaf_layers, 0))) {
        plain.leaves.push_back(plainOrigin(leaf));
        goes_on = false;
      } else if (is_lower) {
        if (!goes_on) {
          plain.whole.push_back(box);
          plain.whole.back().min().z() = std::max(box.min().z(), leaf.z());
        }
        plain.whole.back().max().z() = std::min(box.max().z(), leaf.z() + leaf_layers - 1);
        goes_on = true;
      }
    }
  }
  return plain;
}

}  // namespace

openvdb::BoolGrid::Ptr interlacedByPicking(const openvdb::FloatGrid& refined, ZRange core,
                                           const openvdb::math::Transform& transform) {
  PlainTiles tiles = plainTiles(refined.tree(), core);
  std::vector<Coord>& origins = tiles.leaves;
  for (const FloatLeaf* leaf : leavesIn(refined.tree(), core))
    origins.push_back(plainOrigin(leaf->origin()));
  sortOnce(origins);

  std::vector<SolidLeaf> printed(origins.size());
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, origins.size()), [&](const auto& range) {
    Accessor surface(refined.tree());
    for (std::size_t n = range.begin(); n != range.end(); ++n) {
      const Coord lower(origins[n].x(), 2 * origins[n].y(), origins[n].z());
      const LeafBits rows0 = insideBitsAt(surface, lower, core);
      const LeafBits rows4 = insideBitsAt(surface, lower.offsetBy(0, leaf_layers, 0), core);
      printed[n].origin = origins[n];
      for (unsigned x = 0; x < 8; ++x)
        printed[n].inside[x] = pickedRows(rows0[x]) | std::uint64_t{pickedRows(rows4[x])} << 32;
    }
  });
  return makeSolidGrid(transform, printed, tiles.whole);
}

openvdb::BoolGrid::Ptr interlacedByInterpolation(const openvdb::FloatGrid& surface, ZRange core) {
  std::vector<SolidLeaf> printed;
  Accessor accessor(surface.tree());
  for (const FloatLeaf* leaf : leavesIn(surface.tree(), core)) {
    SolidLeaf made{leaf->origin(), insideBits(*leaf, rowWithin(leaf->origin().z(), core))};
    for (auto voxel = leaf->cbeginValueOn(); voxel; ++voxel) {
      const Coord ijk = voxel.getCoord();
      float beside = 0;
      if (!core.contains(ijk.z()) ||
          !accessor.probeValue(ijk.offsetBy(0, (ijk.z() & 1) ? 1 : -1, 0), beside))
        continue;
      const std::uint64_t bit = std::uint64_t{1} << (voxel.pos() % 64);
      std::uint64_t& word = made.inside[voxel.pos() / 64];
      word = 0.75 * double{*voxel} + 0.25 * double{beside} < 0 ? word | bit : word & ~bit;
    }
    printed.push_back(made);
  }
  return makeSolidGrid(surface.transform(), printed, insideTiles(surface.tree(), core));
}

}  // namespace vdbdither
