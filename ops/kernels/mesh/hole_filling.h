#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "vdbdither/model/mesh.h"

namespace vdbdither {

/// The corners of a hole, in the direction of a triangle that closes it.
using HoleLoop = std::vector<std::uint32_t>;

/// Adds triangles that fill the holes of a mesh, hole by hole: a loop of three corners becomes a
/// triangle, others a fan about their centre.
void fillWithFans(Mesh& mesh, std::span<const HoleLoop> loops);

/// Fills holes along the surface on which the generalized winding number of the open mesh (Jacobson
/// et al. 2013) is one half: a fan that would miss this surface is cut into smaller triangles whose
/// inner corners lie on it. Sides of `loops` are never cut. Where the number stays above one half
/// from the hole up to another part, as between two halves that hardly touch, the filling reaches
/// into that part.
///
/// The volume between fillings and surface is less than a thousandth of the solid's, mostly far
/// less. Holes that are too small to matter, flat or within the solid keep their fan, and so do
/// those whose fan cannot be improved. The result is the same for any number of threads.
///
/// `mesh` in mm, facing outwards, and closed except at the loops.
void fillWhereNumberIsHalf(Mesh& mesh, std::span<const HoleLoop> loops);

}  // namespace vdbdither
