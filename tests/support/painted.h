#pragma once

#include <string>
#include <vector>

#include "vdbdither/openvdb.h"

namespace vdbdither::test {

/// A volume painted in characters: one text per layer from the lowest, in it one line per y from
/// the highest, in it one character per x. `#` is active and true, `.` is background. `origin` is
/// the voxel of the lower left front character.
openvdb::BoolGrid::Ptr painted(const std::vector<std::string>& layers,
                               const openvdb::Coord& origin = {});

/// The same back, over `box`.
std::vector<std::string> picture(const openvdb::BoolGrid& grid, const openvdb::CoordBBox& box);

}  // namespace vdbdither::test
