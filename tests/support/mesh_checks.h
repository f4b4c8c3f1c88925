#pragma once

#include <cstddef>
#include <string>

#include "vdbdither/model/mesh.h"

namespace vdbdither::test {

/// Returns why a mesh is not a closed, consistently oriented manifold, or an empty text. In such a
/// mesh exactly one opposite side meets every side of a triangle, and the triangles at a vertex
/// form one ring.
std::string firstFlaw(const Mesh& mesh);

/// Returns the number of sides without an opposite side.
std::size_t openSides(const Mesh& mesh);

/// Returns vertices − edges + faces: 2 for a sphere, 0 for a torus.
int eulerCharacteristic(const Mesh& mesh);

/// Returns the enclosed volume, mm³; positive if the mesh faces outwards.
double volumeOf(const Mesh& mesh);

}  // namespace vdbdither::test
