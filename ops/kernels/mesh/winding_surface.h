#pragma once

#include <cstddef>
#include <functional>

#include "ops/kernels/mesh/derived_mesh.h"

namespace vdbdither {

/// The surface of the solid that loose triangles suggest: closed, with faces outwards, empty if
/// there is no solid. The source of a triangle is one that the surface follows there, if there is
/// one.
struct WindingSurface : DerivedMesh {
  double cell_mm = 0;   ///< the edge of the smallest cells used
  bool turned = false;  ///< the triangles face inwards: the solid is where the number is below −½
  bool is_given_up = false;  ///< the triangles are too tangled, and the mesh is empty
};

/// Returns the surface of the solid in which the generalized winding number of any set of triangles
/// exceeds ½ (Jacobson et al. 2013). It follows the triangles at which the number passes ½, and
/// between triangles the level ½. If the number is below −½ in more than twice the space in which
/// it is above ½, the triangles are taken as facing inwards and are all turned.
///
/// The mesh is made by dual contouring of an octree: every side of a triangle is met by as many in
/// the opposite direction. Cells divide where one vertex cannot represent the surface, into at most
/// about `max_leaves`. Tangled triangles, of which many count at each place, get fewer and larger
/// cells, so that the work is bounded; it is given up if cells of 1/16 of the longest side are too
/// much work. Walls and gaps thinner than 1/2500 of the longest side may
/// be lost, as may those thinner than a cell that no longer divides. The surface is cut off at half
/// the longest side from the triangles' bounding box. The result is the same for any number of
/// threads.
///
/// `triangles` in mm. `progress` receives fractions, from the calling thread. Throws Interrupted.
WindingSurface windingSurface(const Mesh& triangles,
                              const std::function<void(double)>& progress = {},
                              std::size_t max_leaves = 400'000);

}  // namespace vdbdither
