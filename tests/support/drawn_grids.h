#pragma once

#include <string>
#include <vector>

#include "vdbdither/model/openvdb.h"

namespace vdbdither::test {

/// Returns layers that are drawn as rows of characters, the maximum y first, x from 0. A digit is a
/// value, any other character is empty. The first layer is z = `first_layer`, the last row is y =
/// 0.
openvdb::Int32Grid::Ptr drawnMaterial(const std::vector<std::vector<std::string>>& layers,
                                      int first_layer = 0);

/// Returns the voxels of `values` that are not 0.
openvdb::BoolGrid::Ptr solidOf(const openvdb::Int32Grid& values);

}  // namespace vdbdither::test
