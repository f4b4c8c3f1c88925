#include "tests/support/contract.h"

#include "io/vdb/vdb.h"
#include "tests/support/filters.h"
#include "tests/support/slabs.h"
#include "vdbdither/engine/window.h"
#include "vdbdither/model/layers.h"
#include "vdbdither/model/openvdb.h"

namespace vdbdither::test {

namespace {

using openvdb::CoordBBox;

/// Two grids have the same digest if their voxels in `range` have the same values and states.
std::string digest(const GridConstPtr& grid, ZRange range) {
  // A range of leaves never equals that of a whole grid, so the join copies and removes the voxels
  // outside.
  const std::vector<GridLayers> pieces{{grid, {range.begin - 4096, range.end + 4096}}};
  return archiveBytes({{{"grid", pruned(joinLayers(pieces, range))}}, {}}, VdbCodec::mask);
}

std::string layersText(ZRange range) {
  return "layers " + std::to_string(range.begin) + " to " + std::to_string(range.end - 1);
}

}  // namespace

std::string firstBreach(Filter& filter, const Schema& in, const Grids& whole, int height) {
  const ZRange layers = in.lattice.layers();
  const Grids expected = filter.run(slabFor(filter, in.lattice, whole, layers));
  for (const ZRange core : slabsOf(layers, height)) {
    const Slab slab = slabFor(filter, in.lattice, whole, core);
    std::map<std::string, std::string> before;
    for (const auto& [name, grid] : slab.grids) before[name] = digest(grid, layers);
    const Grids made = filter.run(slab);
    for (const auto& [name, grid] : slab.grids) {
      if (digest(grid, layers) != before[name]) return "its input '" + name + "' was changed";
    }
    for (const auto& [name, grid] : made) {
      const ZRange given = alignedToLeaves(core);
      const CoordBBox active = grid->evalActiveVoxelBoundingBox();
      if (!active.empty() && (active.min().z() < core.begin || active.max().z() >= core.end)) {
        return "'" + name + "' has voxels outside " + layersText(core);
      }
      const auto all = expected.find(name);
      if (all == expected.end()) return "'" + name + "' is not made of the whole volume";
      if (digest(grid, intersection(given, layers)) != digest(all->second, core)) {
        return "'" + name +
               "' depends on the slab, or on what lies beyond the declared reach, in " +
               layersText(core);
      }
    }
    Slab empty{core, slab.valid, {}};
    for (const Read& read : filter.reads()) empty.grids[read.grid] = in.grids.at(read.grid);
    addInputs(filter, empty);
    if (filter.run(empty).size() != made.size()) return "it makes other grids of an empty slab";
  }
  return "";
}

}  // namespace vdbdither::test
