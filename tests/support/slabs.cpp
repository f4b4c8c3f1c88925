#include "tests/support/slabs.h"

#include "tests/support/filters.h"
#include "vdbdither/engine/window.h"
#include "vdbdither/model/layers.h"
#include "vdbdither/model/openvdb.h"

namespace vdbdither::test {

using openvdb::CoordBBox;

namespace {

/// A copy of `grid` within `valid`; outside, every voxel of `box` is active and holds rubbish.
GridConstPtr spoiled(const GridConstPtr& grid, ZRange valid, const CoordBBox& box) {
  const std::vector<GridLayers> pieces{{grid, {valid.begin - 4096, valid.end + 4096}}};
  const openvdb::GridBase::Ptr copy = joinLayers(pieces, valid)->deepCopyGrid();
  const auto fill = [&](auto& typed, const auto& rubbish) {
    for (const ZRange outside :
         {ZRange{box.min().z(), valid.begin}, ZRange{valid.end, box.max().z() + 1}})
      if (!outside.empty()) typed.denseFill(inLayers(box, outside), rubbish, true);
  };
  if (const auto floats = openvdb::gridPtrCast<openvdb::FloatGrid>(copy)) fill(*floats, -0.011F);
  if (const auto normals = openvdb::gridPtrCast<openvdb::Vec3SGrid>(copy))
    fill(*normals, openvdb::Vec3s(0.6F, 0.0F, -0.8F));
  if (const auto bits = openvdb::gridPtrCast<openvdb::BoolGrid>(copy)) fill(*bits, true);
  if (const auto integers = openvdb::gridPtrCast<openvdb::Int32Grid>(copy)) fill(*integers, 7);
  return copy;
}

}  // namespace

Slab slabFor(Filter& filter, const Lattice& lattice, const Grids& grids, ZRange core) {
  const ZRange layers = lattice.layers();
  Slab slab{core, reached(core, widest(filter.reads()), layers), {}};
  for (const Read& read : filter.reads())
    slab.grids[read.grid] =
        spoiled(grids.at(read.grid), reached(core, read.reach, layers), lattice.box);
  addInputs(filter, slab);
  return slab;
}

std::vector<Slab> cutIntoSlabs(const Grids& grids, const Lattice& lattice, int height) {
  std::vector<Slab> slabs;
  const ZRange layers = lattice.layers();
  for (const ZRange core : slabsOf(layers, height)) {
    Slab& slab = slabs.emplace_back(Slab{core, core, {}});
    for (const auto& [name, grid] : grids) {
      const GridLayers piece{grid, layers};
      slab.grids[name] = joinLayers({&piece, 1}, core);
    }
  }
  return slabs;
}

}  // namespace vdbdither::test
