#pragma once

#include <string>

#include "vdbdither/engine/operator.h"

namespace vdbdither::test {

/// Holds a planned filter against what every filter promises (docs/writing-an-operator.md): the
/// same voxels for slabs of `height` layers as for the whole, whatever lies outside its declared
/// reach; voxels only within the core; inputs left as they were; empty slabs accepted. Returns the
/// first breach in words, or nothing.
std::string firstBreach(Filter& filter, const Schema& in, const Grids& whole, int height);

}  // namespace vdbdither::test
