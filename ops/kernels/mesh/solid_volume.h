#pragma once

#include "ops/kernels/mesh/solid_mesh.h"

namespace vdbdither {

/// Returns the volume of the solid, mm³: where the winding number is not zero. Exact where no
/// shells overlap; otherwise summed up along lines, to about 1e-5 of the volume. Throws
/// Interrupted.
double volumeOf(const SolidMesh& solid);

}  // namespace vdbdither
