#include "tests/support/filters.h"

#include <algorithm>

#include <gtest/gtest.h>

#include "vdbdither/engine/options.h"
#include "vdbdither/engine/registry.h"

namespace vdbdither::test {

using openvdb::BoolGrid;
using openvdb::CoordBBox;
using openvdb::FloatGrid;
using openvdb::Vec3s;
using openvdb::Vec3SGrid;

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

namespace {

/// A copy of `grid` in which every voxel of every leaf outside `valid` is active and holds rubbish.
template <typename GridType>
GridConstPtr spoiled(const GridType& grid, ZRange valid,
                     const typename GridType::ValueType& rubbish) {
  auto copy = grid.deepCopy();
  for (auto leaf = copy->tree().beginLeaf(); leaf; ++leaf) {
    for (openvdb::Index n = 0; n < 512; ++n) {
      if (!valid.contains(leaf->offsetToGlobalCoord(n).z())) leaf->setValueOn(n, rubbish);
    }
  }
  return copy;
}

GridConstPtr spoiled(const GridConstPtr& grid, ZRange valid) {
  if (const auto floats = openvdb::gridConstPtrCast<FloatGrid>(grid))
    return spoiled(*floats, valid, -0.011F);
  return spoiled(*openvdb::gridConstPtrCast<Vec3SGrid>(grid), valid, Vec3s(0.6F, 0.0F, -0.8F));
}

}  // namespace

std::vector<std::pair<ZRange, Grids>> runInSlabs(Filter& filter, const Schema& schema, int height) {
  filter.plan(schema);
  const ZRange layers = schema.lattice.layers();
  std::vector<std::pair<ZRange, Grids>> results;
  for (int begin = alignedToLeaves(layers).begin; begin < layers.end; begin += height) {
    Slab slab;
    slab.core = intersection({begin, begin + height}, layers);
    slab.valid = slab.core;
    for (const Read& read : filter.reads()) {
      const ZRange reach = intersection(
          {slab.core.begin - read.reach.below, slab.core.end + read.reach.above}, layers);
      slab.valid = {std::min(slab.valid.begin, reach.begin), std::max(slab.valid.end, reach.end)};
      slab.grids[read.grid] = spoiled(schema.grids.at(read.grid), reach);
    }
    addInputs(filter, slab);
    results.emplace_back(slab.core, filter.run(slab));
  }
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
    CoordBBox layers = box;
    layers.min().z() = core.begin;
    layers.max().z() = core.end - 1;
    for (auto v = layers.begin(); v; ++v) voxels[*v] = solid->tree().getValue(*v) ? 1 : 0;
  }
  return voxels;
}

}  // namespace vdbdither::test
