#pragma once

#include <string>
#include <vector>

#include "vdbdither/model/openvdb.h"

namespace vdbdither::test {

/// Layers drawn as rows of characters, the greatest y first, x from 0: a digit is a value, anything
/// else is empty. The first layer is z = `first_layer`, and the last row is y = 0.
openvdb::Int32Grid::Ptr drawnMaterial(const std::vector<std::vector<std::string>>& layers,
                                      int first_layer = 0);

/// The voxels of `values` that are not 0.
openvdb::BoolGrid::Ptr solidOf(const openvdb::Int32Grid& values);

}  // namespace vdbdither::test
