#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "vdbdither/model/mesh.h"

namespace vdbdither {

/// Corners of a hole, in the direction in which a triangle that closes it has them.
using HoleLoop = std::vector<std::uint32_t>;

/// Adds triangles that fill the holes of a mesh, hole by hole: a loop of three becomes a triangle,
/// others a fan about their middle.
void fillWithFans(Mesh& mesh, std::span<const HoleLoop> loops);

/// The same, but where a fan would miss the surface on which the generalized winding number of the
/// open mesh (Jacobson, Kavan, Sorkine-Hornung, "Robust inside-outside segmentation using
/// generalized winding numbers", 2013) is one half, it is cut into smaller triangles whose inner
/// corners lie on that surface. Sides of `loops` are never cut. Where the number is above one half
/// before the hole until another part begins, as between two halves that hardly touch, the filling
/// reaches into that part.
///
/// What is left between fillings and surface comes to less than a thousandth of the solid's volume,
/// mostly far less. Holes that are too small to matter, flat or within the solid keep their fan,
/// and so do those whose fan cannot be bettered. The same bits for any number of threads.
///
/// `mesh` in mm, faces outwards; without the loops' sides it would be closed.
void fillWhereNumberIsHalf(Mesh& mesh, std::span<const HoleLoop> loops);

}  // namespace vdbdither
