#pragma once

#include <cstddef>
#include <functional>

#include "ops/kernels/mesh/derived_mesh.h"

namespace vdbdither {

/// The surface of a solid that triangles hint at: closed, faces outwards, empty where there is no
/// solid. The source of a triangle is one that the surface follows there; none between triangles.
struct WindingSurface : DerivedMesh {
  double cell_mm = 0;   ///< the edge of the smallest cells that it was found on
  bool turned = false;  ///< the triangles face inwards: what counts is the number below −½
};

/// The surface of the set where the generalized winding number of any set of triangles exceeds ½
/// (Jacobson, Kavan, Sorkine-Hornung: "Robust inside-outside segmentation using generalized winding
/// numbers", 2013): on the triangles where they part it from the rest, and between them where the
/// number is ½. Where the number is below −½ in more than twice the space in which it is above ½,
/// the triangles are inside out, and all of them are taken the other way round.
///
/// By dual contouring of an octree: every side of a triangle is met by as many in the opposite
/// direction. The cells divide where one vertex does not tell what the surface does, into at most
/// about `max_leaves`. Walls and gaps thinner than 1/2500 of the longest side may be lost, and so
/// may what is thinner than a cell where the cells no longer divide. What lies farther from the
/// triangles' bounding box than half its longest side is left out. The same bits for any number of
/// threads.
///
/// `triangles` in mm. `progress` is told fractions, from the calling thread.
WindingSurface windingSurface(const Mesh& triangles,
                              const std::function<void(double)>& progress = {},
                              std::size_t max_leaves = 3'000'000);

}  // namespace vdbdither
