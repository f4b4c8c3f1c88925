#include "ops/kernels/interlace.h"

#include <set>

#include "ops/kernels/leaf_bits.h"
#include "ops/kernels/solid.h"

namespace vdbdither {

using openvdb::Coord;
using openvdb::CoordBBox;
using openvdb::FloatTree;

namespace {

using Accessor = openvdb::tree::ValueAccessor<const FloatTree, false>;

/// V among the 8³ voxels at `origin`, be they a leaf or part of a tile.
LeafBits insideBitsAt(Accessor& surface, const Coord& origin, ZRange layers) {
  const std::uint8_t row = rowWithin(origin.z(), layers);
  if (const FloatLeaf* leaf = surface.probeConstLeaf(origin)) return insideBits(*leaf, row);
  LeafBits bits;
  bits.fill(surface.getValue(origin) < 0.0F ? everyRow(row) : 0);
  return bits;
}

/// Four rows of the plain lattice from eight refined ones: the even rows on even slices, the odd
/// ones on odd slices.
std::uint32_t pickedRows(std::uint64_t refined) {
  std::uint32_t picked = 0;
  for (unsigned j = 0; j < 4; ++j) {
    const std::uint64_t even = (refined >> (16 * j)) & 0x55U;
    const std::uint64_t odd = (refined >> (16 * j + 8)) & 0xaaU;
    picked |= static_cast<std::uint32_t>(even | odd) << (8 * j);
  }
  return picked;
}

}  // namespace

openvdb::BoolGrid::Ptr interlacedByPicking(const openvdb::FloatGrid& refined, ZRange core,
                                           const openvdb::math::Transform& transform) {
  // The plain leaves that a refined leaf falls into; refined leaves come in pairs along y.
  const auto plainOrigin = [](const Coord& origin) {
    return Coord(origin.x(), (origin.y() >> 4) * 8, origin.z());
  };
  std::set<Coord> origins;
  for (const FloatLeaf* leaf : leavesIn(refined.tree(), core))
    origins.insert(plainOrigin(leaf->origin()));

  std::vector<SolidLeaf> printed;
  Accessor surface(refined.tree());
  for (const Coord& origin : origins) {
    const Coord lower(origin.x(), 2 * origin.y(), origin.z());
    const LeafBits rows0 = insideBitsAt(surface, lower, core);
    const LeafBits rows4 = insideBitsAt(surface, lower.offsetBy(0, 8, 0), core);
    SolidLeaf leaf{origin, {}};
    for (unsigned x = 0; x < 8; ++x) {
      leaf.inside[x] = pickedRows(rows0[x]) | std::uint64_t{pickedRows(rows4[x])} << 32;
    }
    printed.push_back(leaf);
  }

  std::vector<CoordBBox> boxes = insideTiles(refined.tree(), core);
  for (CoordBBox& box : boxes) {
    box.min().y() >>= 1;
    box.max().y() >>= 1;
  }
  return makeSolidGrid(transform, printed, boxes);
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
