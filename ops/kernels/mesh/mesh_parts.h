#pragma once

#include <vector>

#include "vdbdither/model/mesh.h"

namespace vdbdither {

/// Returns the parts that a mesh names, in their order, each with its own vertices. Returns the
/// mesh alone where it names none, where a name comes again after another, or where a part by
/// itself is not closed: such parts are pieces of one surface, as the patches of a flow simulation
/// are.
std::vector<Mesh> partsOf(Mesh mesh);

}  // namespace vdbdither
