#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <openvdb/Types.h>

#include "ops/kernels/mesh/box_tree.h"
#include "ops/kernels/mesh/mesh_bodies.h"
#include "vdbdither/model/mesh.h"

namespace vdbdither {

/// The winding number of a closed mesh beside its triangles, counted where a line along an axis
/// passes them. The counts are exact: what a side contributes depends on the side alone, so that
/// the crossings of any line cancel in a mesh whose sides meet opposite ones.
///
/// A body is closed, so only those whose box holds a place are asked.
class LineWinding {
 public:
  /// The numbers at both sides of a surface.
  struct Sides {
    int front = 0;  ///< where the normal points
    int back = 0;

    Sides& operator+=(const Sides& other) {
      front += other.front;
      back += other.back;
      return *this;
    }
  };

  /// `boxes` are those of the triangles, or larger. `mesh` and `boxes` must outlive this.
  LineWinding(const Mesh& mesh, const MeshBodies& bodies, const std::vector<BoxTree::Box>& boxes);

  /// Returns the numbers at the distance `beside_mm` from a plane through p. `normal` is the unit
  /// normal of the plane. The bodies `except`, in rising order, do not count.
  [[nodiscard]] Sides at(const openvdb::Vec3d& p, const openvdb::Vec3d& normal, double beside_mm,
                         std::span<const std::uint32_t> except = {}) const;

  /// Returns the numbers of one body there.
  [[nodiscard]] Sides ofBody(std::uint32_t body, const openvdb::Vec3d& p,
                             const openvdb::Vec3d& normal, double beside_mm) const;

 private:
  class Line;

  [[nodiscard]] Sides ofBody(std::uint32_t body, const Line& line) const;

  const Mesh& mesh_;
  std::vector<BoxTree::Box> body_boxes_;
  std::vector<BoxTree> triangles_;  ///< by body
  BoxTree bodies_;
};

}  // namespace vdbdither
