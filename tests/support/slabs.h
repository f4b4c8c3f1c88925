#pragma once

#include <vector>

#include "tests/support/volumes.h"
#include "vdbdither/engine/operator.h"

namespace vdbdither::test {

/// What `filter` gets for `core`: its own copy of every grid that it declares to read, with rubbish
/// in place of the layers beyond the declared reach, and what it reads from its inputs.
Slab slabFor(Filter& filter, const Lattice& lattice, const Grids& grids, ZRange core);

/// `grids` on `lattice` as a chain hands them on: in slabs of `height` layers, with no layers
/// around them.
std::vector<Slab> cutIntoSlabs(const Grids& grids, const Lattice& lattice, int height);

}  // namespace vdbdither::test
