#pragma once

#include <cstdint>
#include <vector>

#include <openvdb/Types.h>

#include "ops/kernels/mesh/box_tree.h"
#include "ops/kernels/mesh/mesh_edges.h"
#include "vdbdither/model/mesh.h"

namespace vdbdither {

/// The winding number of a closed mesh beside its triangles, counted where a line along an axis
/// passes them. The counts are exact: what a side contributes depends on the side alone, so that
/// the crossings of any line cancel in a mesh whose sides meet opposite ones.
///
/// Triangles that share sides form a body. A body is closed, so only those whose box holds a place
/// are asked.
class LineWinding {
 public:
  /// The numbers at both sides of a surface.
  struct Sides {
    int front = 0;  ///< where the normal points
    int back = 0;
  };

  /// `boxes` are those of the triangles, or larger. All three must outlive this.
  LineWinding(const Mesh& mesh, const MeshEdges& edges, const std::vector<BoxTree::Box>& boxes);

  /// Returns the numbers at the distance `beside_mm` from a plane through p. `normal` is the unit
  /// normal of the plane.
  [[nodiscard]] Sides at(const openvdb::Vec3d& p, const openvdb::Vec3d& normal,
                         double beside_mm) const;

 private:
  const Mesh& mesh_;
  std::vector<BoxTree::Box> body_boxes_;
  std::vector<BoxTree> triangles_;  ///< by body
  BoxTree bodies_;
};

}  // namespace vdbdither
