#pragma once

#include "vdbdither/model/errors.h"
#include "vdbdither/model/openvdb.h"

namespace vdbdither {

/// The types of grids that slabs can carry.
using CarriedGrids = openvdb::TypeList<openvdb::FloatGrid, openvdb::DoubleGrid, openvdb::Int32Grid,
                                       openvdb::Int64Grid, openvdb::Vec3SGrid, openvdb::Vec3DGrid,
                                       openvdb::BoolGrid, openvdb::MaskGrid>;

/// Calls `function` with the grid as what it is. Throws DataError for a type that slabs cannot
/// carry (points, strings).
template <typename Function>
void visitGrid(const openvdb::GridBase& grid, const Function& function) {
  if (!grid.apply<CarriedGrids>(function)) {
    throw DataError("grid '" + grid.getName() + "' is of type " + grid.type() +
                    ", which slabs cannot carry");
  }
}

}  // namespace vdbdither
