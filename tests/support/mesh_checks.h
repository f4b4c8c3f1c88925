#pragma once

#include <cstddef>
#include <string>

#include "vdbdither/model/mesh.h"

namespace vdbdither::test {

/// What keeps a mesh from being a closed, consistently oriented manifold, or nothing: every side of
/// a triangle is met by exactly one other in the opposite direction, and the triangles at a vertex
/// form one ring.
std::string firstFlaw(const Mesh& mesh);

/// How many sides are not met by as many in the opposite direction.
std::size_t openSides(const Mesh& mesh);

/// Vertices − edges + faces: 2 for every sphere, 0 for every torus.
int eulerCharacteristic(const Mesh& mesh);

/// What the mesh encloses, mm³; positive where it faces outwards.
double volumeOf(const Mesh& mesh);

}  // namespace vdbdither::test
