#include "ops/kernels/leaf/part_index.h"

#include <algorithm>
#include <limits>
#include <numeric>
#include <vector>

#include <openvdb/tools/Prune.h>
#include <tbb/parallel_for.h>

#include "vdbdither/model/known_grids.h"

namespace vdbdither {

using openvdb::Coord;
using openvdb::CoordBBox;
using openvdb::FloatGrid;
using openvdb::Int32Tree;

namespace {

using Accessor = openvdb::tree::ValueAccessor<const openvdb::FloatTree>;
using Leaf = Int32Tree::LeafNodeType;

/// Fills the tiles inside a part, except where an earlier call has filled.
void fillInterior(const FloatGrid& surface, int part, Int32Tree& parts) {
  for (auto tile = surface.tree().cbeginValueOff(); tile; ++tile) {
    if (tile.isVoxelValue() || !(*tile < 0)) continue;
    const CoordBBox box = tile.getBoundingBox();
    for (int x = box.min().x(); x <= box.max().x(); x += Leaf::DIM) {
      for (int y = box.min().y(); y <= box.max().y(); y += Leaf::DIM) {
        for (int z = box.min().z(); z <= box.max().z(); z += Leaf::DIM) {
          const Coord origin(x, y, z);
          if (!parts.probeConstLeaf(origin) && !parts.isValueOn(origin)) {
            parts.addTile(1, origin, part, true);
          }
        }
      }
    }
  }
}

/// `numbers` are those of the surfaces, the part to prefer first.
void fillLeaf(Leaf& leaf, std::span<const int> numbers, std::vector<Accessor>& surfaces) {
  for (openvdb::Index n = 0; n < Leaf::SIZE; ++n) {
    const Coord ijk = leaf.offsetToGlobalCoord(n);
    int nearest = 0;
    float minimum = std::numeric_limits<float>::infinity();
    for (std::size_t part = 0; part < surfaces.size() && !(minimum < 0); ++part) {
      float distance = 0;
      const bool active = surfaces[part].probeValue(ijk, distance);
      if ((active || distance < 0) && distance < minimum) {
        minimum = distance;
        nearest = numbers[part];
      }
    }
    if (nearest) {
      leaf.setValueOn(n, nearest);
    } else {
      leaf.setValueOff(n, 0);
    }
  }
}

}  // namespace

openvdb::Int32Grid::Ptr partIndex(std::span<const FloatGrid::ConstPtr> given, PartOrder order) {
  std::vector<FloatGrid::ConstPtr> surfaces(given.begin(), given.end());
  std::vector<int> numbers(surfaces.size());
  std::iota(numbers.begin(), numbers.end(), 1);
  if (order == PartOrder::last) {
    std::reverse(surfaces.begin(), surfaces.end());
    std::reverse(numbers.begin(), numbers.end());
  }
  auto grid = openvdb::Int32Grid::create(0);
  grid->setName(part_grid);
  grid->insertMeta(part_count_key,
                   openvdb::Int32Metadata(static_cast<std::int32_t>(surfaces.size())));
  Int32Tree& parts = grid->tree();
  for (const FloatGrid::ConstPtr& surface : surfaces) {
    grid->setTransform(surface->transform().copy());
    for (auto leaf = surface->tree().cbeginLeaf(); leaf; ++leaf) parts.touchLeaf(leaf->origin());
  }
  std::vector<Leaf*> leaves;
  parts.getNodes(leaves);
  tbb::parallel_for(std::size_t{0}, leaves.size(), [&](std::size_t i) {
    std::vector<Accessor> accessors;
    accessors.reserve(surfaces.size());
    for (const FloatGrid::ConstPtr& surface : surfaces) accessors.emplace_back(surface->tree());
    fillLeaf(*leaves[i], numbers, accessors);
  });
  for (std::size_t part = 0; part < surfaces.size(); ++part) {
    fillInterior(*surfaces[part], numbers[part], parts);
  }
  openvdb::tools::prune(parts);
  return grid;
}

}  // namespace vdbdither
