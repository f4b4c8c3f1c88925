#include "ops/kernels/distance/csg.h"

#include <algorithm>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include <openvdb/tools/Prune.h>

#include "ops/kernels/leaf/held_band.h"
#include "ops/kernels/leaf/leaf_bits.h"
#include "ops/kernels/leaf/leaf_origins.h"
#include "ops/kernels/leaf/solid.h"
#include "ops/kernels/leaf/surface_leaves.h"
#include "ops/kernels/leaf/tie.h"
#include "vdbdither/model/known_grids.h"

namespace vdbdither {

using openvdb::Coord;
using openvdb::CoordBBox;
using openvdb::FloatGrid;
using openvdb::Int32Grid;

namespace {

using Accessor = openvdb::tree::ValueAccessor<const openvdb::FloatTree, false>;

/// Returns the leaves of either, each once.
std::vector<Coord> leafOrigins(const FloatGrid& a, const FloatGrid& b, ZRange core) {
  std::vector<Coord> origins;
  for (const FloatGrid* grid : {&a, &b}) appendLeafOrigins(grid->tree(), core, origins);
  sortOnce(origins);
  return origins;
}

/// Calls `visit` with the leaf-sized pieces of the tiles inside `surface`, cut to `core`.
template <typename Visit>
void visitInsideBlocks(const FloatGrid& surface, ZRange core, const Visit& visit) {
  for (const CoordBBox& box : insideTiles(surface.tree(), core)) {
    for (int x = box.min().x(); x <= box.max().x(); x += leaf_layers) {
      for (int y = box.min().y(); y <= box.max().y(); y += leaf_layers) {
        for (int z = box.min().z(); z <= box.max().z();) {
          const int top = std::min(box.max().z(), (z | (leaf_layers - 1)));
          visit(CoordBBox(Coord(x, y, z), Coord(x + leaf_layers - 1, y + leaf_layers - 1, top)));
          z = top + 1;
        }
      }
    }
  }
}

}  // namespace

FloatGrid::Ptr emptyCombined(const FloatGrid& a, const FloatGrid& b) {
  FloatGrid::Ptr grid = emptySurface(a, std::min(a.background(), b.background()));
  setHeldBandMm(*grid, std::min({heldBandMm(a), heldBandMm(b), double{grid->background()}}));
  return grid;
}

FloatGrid::Ptr combined(const FloatGrid& a, const FloatGrid& b, Csg operation, ZRange core) {
  const std::vector<Coord> origins = leafOrigins(a, b, core);
  std::vector<LeafValues> leaves(origins.size());
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, origins.size()), [&](const auto& range) {
    const Accessor of_a(a.tree());
    const Accessor of_b(b.tree());
    for (std::size_t n = range.begin(); n != range.end(); ++n) {
      LeafValues values = LeafValues::of(of_a, origins[n]);
      const LeafValues other = LeafValues::of(of_b, origins[n]);
      for (unsigned offset = 0; offset < 512; ++offset) {
        const float mine = values.distance[offset];
        const float others = operation == Csg::subtract ? complemented(other.distance[offset])
                                                        : other.distance[offset];
        const bool take = operation == Csg::unite ? others < mine : others > mine;
        if (!take) continue;
        const std::uint64_t bit = std::uint64_t{1} << (offset % 64);
        values.distance[offset] = others;
        values.active[offset / 64] =
            (values.active[offset / 64] & ~bit) | (other.active[offset / 64] & bit);
      }
      leaves[n] = values;
    }
  });

  std::vector<CoordBBox> inside;
  if (operation == Csg::unite) {
    inside = insideTiles(a.tree(), core);
    const std::vector<CoordBBox> more = insideTiles(b.tree(), core);
    inside.insert(inside.end(), more.begin(), more.end());
  } else {
    const Accessor of_b(b.tree());
    visitInsideBlocks(a, core, [&](const CoordBBox& block) {
      if (of_b.probeConstLeaf(block.min())) return;
      if ((of_b.getValue(block.min()) < 0) == (operation == Csg::intersect))
        inside.push_back(block);
    });
  }
  const FloatGrid::Ptr empty = emptyCombined(a, b);
  FloatGrid::Ptr grid = surfaceOf(*empty, empty->background(), core, origins, leaves, inside);
  setHeldBandMm(*grid, heldBandMm(*empty));
  return grid;
}

Int32Grid::Ptr unitedParts(const FloatGrid& a, const FloatGrid& b, const Int32Grid* a_parts,
                           const Int32Grid* b_parts, int shift, bool b_first, ZRange core) {
  using IntLeaf = openvdb::Int32Tree::LeafNodeType;
  auto grid = Int32Grid::create(0);
  grid->setName(part_grid);
  grid->setTransform(a.transform().copy());

  // Where either has a leaf of distances or of parts, voxels are assigned one by one.
  std::vector<Coord> origins = leafOrigins(a, b, core);
  for (const Int32Grid* parts : {a_parts, b_parts})
    if (parts) appendLeafOrigins(parts->tree(), core, origins);
  sortOnce(origins);

  struct Side {
    Side(const FloatGrid& surface, const Int32Grid* grid_of_parts, int first)
        : distance(surface.tree()), shift(first) {
      if (grid_of_parts) parts.emplace(grid_of_parts->tree());
    }
    /// Returns the part at a voxel, 0 if there is none, and its distance.
    std::pair<int, float> at(const Coord& ijk) {
      float d = 0;
      const bool active = distance.probeValue(ijk, d);
      const int part = parts ? parts->getValue(ijk) : active || d < 0 ? 1 : 0;
      return {part > 0 ? part + shift : 0, d};
    }
    Accessor distance;
    std::optional<openvdb::tree::ValueAccessor<const openvdb::Int32Tree, false>> parts;
    int shift;
  };
  const auto decide = [b_first](Side& of_a, Side& of_b, const Coord& ijk) {
    const auto [part_a, d_a] = of_a.at(ijk);
    const auto [part_b, d_b] = of_b.at(ijk);
    if (part_a == 0 || part_b == 0) return part_a + part_b;
    if (d_a < 0 && d_b < 0) return b_first ? part_b : part_a;
    return d_b < d_a ? part_b : part_a;
  };

  {
    Side of_a(a, a_parts, 0);
    Side of_b(b, b_parts, shift);
    for (const FloatGrid* surface : {&a, &b}) {
      visitInsideBlocks(*surface, core, [&](const CoordBBox& block) {
        grid->tree().sparseFill(block, decide(of_a, of_b, block.min()), true);
      });
    }
  }
  std::vector<std::unique_ptr<IntLeaf>> made(origins.size());
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, origins.size()), [&](const auto& range) {
    Side of_a(a, a_parts, 0);
    Side of_b(b, b_parts, shift);
    for (std::size_t n = range.begin(); n != range.end(); ++n) {
      const std::uint8_t within = rowWithin(origins[n].z(), core);
      made[n] = std::make_unique<IntLeaf>(origins[n], 0, false);
      for (unsigned offset = 0; offset < 512; ++offset) {
        if (!(within >> (offset % 8) & 1U)) continue;
        const int part = decide(of_a, of_b, made[n]->offsetToGlobalCoord(offset));
        if (part != 0) made[n]->setValueOn(offset, part);
      }
    }
  });
  for (auto& leaf : made) grid->tree().addLeaf(leaf.release());
  openvdb::tools::prune(grid->tree());
  return grid;
}

}  // namespace vdbdither
