#include "tests/support/filters.h"

#include <gtest/gtest.h>

#include "tests/support/slabs.h"
#include "vdbdither/engine/options.h"
#include "vdbdither/engine/registry.h"

namespace vdbdither::test {

using openvdb::BoolGrid;
using openvdb::CoordBBox;

std::unique_ptr<Filter> filterCalled(const std::string& name,
                                     const std::vector<std::string>& arguments) {
  auto op = findOperator(name).make();
  Options options;
  op->declare(options);
  options.parse(arguments);
  return std::unique_ptr<Filter>(&dynamic_cast<Filter&>(*op.release()));
}

Schema schemaOf(const Lattice& lattice, Grids grids) {
  Schema schema;
  schema.lattice = lattice;
  schema.grids = std::move(grids);
  return schema;
}

Schema ballWithBand(const Lattice& lattice, double radius_mm, double band_mm) {
  return schemaOf(lattice, {{"surface", sampled(sphere({0, 0, 0}, radius_mm), lattice, band_mm)}});
}

void addInputs(Filter& filter, Slab& slab) {
  for (Input* input : filter.inputs()) {
    const ZRange there = intersection(slab.core, input->schema().lattice.layers());
    slab.inputs.push_back(there.empty() ? Grids() : input->read(there));
  }
}

Grids runWhole(Filter& filter, const Schema& schema) {
  filter.plan(schema);
  Slab slab{schema.lattice.layers(), schema.lattice.layers(), {}};
  for (const Read& read : filter.reads()) slab.grids[read.grid] = schema.grids.at(read.grid);
  addInputs(filter, slab);
  return filter.run(slab);
}

std::vector<std::pair<ZRange, Grids>> runInSlabs(Filter& filter, const Schema& schema, int height) {
  filter.plan(schema);
  std::vector<std::pair<ZRange, Grids>> results;
  for (const ZRange core : slabsOf(schema.lattice.layers(), height))
    results.emplace_back(core, filter.run(slabFor(filter, schema.lattice, schema.grids, core)));
  return results;
}

Voxels solidOfSlabs(Filter& filter, const Schema& schema, int height, const CoordBBox& box) {
  Voxels voxels(box, 0);
  for (const auto& [core, grids] : runInSlabs(filter, schema, height)) {
    const auto solid = openvdb::gridConstPtrCast<BoolGrid>(grids.at("solid"));
    for (auto v = solid->cbeginValueOn(); v; ++v) {
      const CoordBBox filled = v.getBoundingBox();
      EXPECT_TRUE(core.contains(filled.min().z()) && core.contains(filled.max().z())) << filled;
    }
    for (auto v = inLayers(box, core).begin(); v; ++v)
      voxels[*v] = solid->tree().getValue(*v) ? 1 : 0;
  }
  return voxels;
}

}  // namespace vdbdither::test
