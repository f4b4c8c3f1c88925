#pragma once

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "tests/support/volumes.h"
#include "vdbdither/engine/operator.h"

namespace vdbdither::test {

/// Returns the registered filter of that name with its options set.
std::unique_ptr<Filter> filterCalled(const std::string& name,
                                     const std::vector<std::string>& arguments = {});

/// Returns a schema of these grids on a lattice.
Schema schemaOf(const Lattice& lattice, Grids grids);

/// Returns the schema of the grid `surface` of a ball around the origin with a band of `band_mm`.
Schema ballWithBand(const Lattice& lattice, double radius_mm, double band_mm);

/// Returns a function that plans the filter of that name.
inline auto planning(const std::string& name, const Schema& schema,
                     const std::vector<std::string>& arguments) {
  return [=] { filterCalled(name, arguments)->plan(schema); };
}

/// Adds the grids of the filter's inputs over the core of `slab`, as the engine does.
void addInputs(Filter& filter, Slab& slab);

/// What `filter`, planned on these grids, makes of the whole lattice in one slab.
Grids runWhole(Filter& filter, const Schema& schema);

/// What it makes of slabs of `height` layers, each as `slabFor` gives it.
std::vector<std::pair<ZRange, Grids>> runInSlabs(Filter& filter, const Schema& schema, int height);

/// Returns the grid `solid` of all those slabs over `box`. Fails the test if a slab has voxels
/// outside its core.
Voxels solidOfSlabs(Filter& filter, const Schema& schema, int height,
                    const openvdb::CoordBBox& box);

}  // namespace vdbdither::test
