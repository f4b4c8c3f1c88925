#pragma once

#include <cstddef>
#include <functional>

#include "vdbdither/mesh.h"

namespace vdbdither {

/// The surface of a solid that triangles hint at.
struct WindingSurface {
  Mesh mesh;            ///< closed, faces outwards; empty where there is no solid
  double cell_mm = 0;   ///< the edge of the cells that it was found on
  bool turned = false;  ///< the triangles face inwards: what counts is the number below −½
};

/// The surface of the set where the generalized winding number of any set of triangles exceeds ½
/// (Jacobson, Kavan, Sorkine-Hornung: "Robust inside-outside segmentation using generalized winding
/// numbers", 2013): on the triangles where they part it from the rest, and between them where the
/// number is ½. Where the number is below −½ in more than twice the space in which it is above ½,
/// the triangles are inside out, and all of them are taken the other way round.
///
/// By marching cubes: every side of a triangle is met by exactly one other, in the opposite
/// direction. Vertices lie within a thousandth of a cell of the set's surface; between them, at
/// sharp edges and in walls thinner than a cell, it is as true as the cells are fine. What lies
/// farther from the triangles' bounding box than half its longest side is left out. The same bits
/// for any number of threads.
///
/// `triangles` in mm. `progress` is told fractions, from the calling thread.
WindingSurface windingSurface(const Mesh& triangles,
                              const std::function<void(double)>& progress = {},
                              std::size_t most_leaves = 1'500'000);

}  // namespace vdbdither
