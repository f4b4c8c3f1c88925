#pragma once

#include <string>

#include "vdbdither/engine/operator.h"

namespace vdbdither::test {

/// Checks the contract of filters (docs/writing-an-operator.md) for a planned filter: slabs of
/// `height` layers give the same voxels as the whole, for any values outside the declared reach;
/// voxels lie only within the core; inputs stay unchanged; empty slabs are accepted. Returns a
/// description of the first breach, or an empty text.
std::string firstBreach(const Filter& filter, const Schema& in, const Grids& whole, int height);

}  // namespace vdbdither::test
