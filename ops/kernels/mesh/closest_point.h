#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include <openvdb/math/Vec3.h>

#include "vdbdither/model/mesh.h"

namespace vdbdither {

/// The shares of the corners of a triangle in a point of it; they sum to 1.
using CornerWeights = std::array<double, 3>;

/// Where the nearest point of a triangle to a given one lies.
struct PlaceOnTriangle {
  int where;  ///< 0–2: a corner; 3–5: the side from corner n − 3; 6: the face
  CornerWeights weights;

  [[nodiscard]] std::optional<std::size_t> corner() const {
    return where < 3 ? std::optional(static_cast<std::size_t>(where)) : std::nullopt;
  }
  [[nodiscard]] std::optional<std::size_t> side() const {
    return where >= 3 && where < 6 ? std::optional(static_cast<std::size_t>(where - 3))
                                   : std::nullopt;
  }
};

/// Returns where the point of the triangle a, b, c nearest to p lies (Ericson 2005, 5.1.5).
PlaceOnTriangle nearestPlace(const openvdb::Vec3d& a, const openvdb::Vec3d& b,
                             const openvdb::Vec3d& c, const openvdb::Vec3d& p);

/// The nearest point of a triangle to a given one.
struct PointOnTriangle {
  openvdb::Vec3d point;
  PlaceOnTriangle place;
};

/// Returns the point of the triangle a, b, c nearest to p.
PointOnTriangle nearestOnTriangle(const openvdb::Vec3d& a, const openvdb::Vec3d& b,
                                  const openvdb::Vec3d& c, const openvdb::Vec3d& p);

/// The nearest point of a mesh to a given one.
struct ClosestPoint {
  double distance_mm = 0;      ///< negative inside the mesh
  openvdb::Vec3d point;        ///< on the mesh
  std::uint32_t triangle = 0;  ///< that the point lies on; the lowest of several
};

/// Exact signed distances from any point to a closed mesh, through a tree of bounding boxes.
///
/// The sign is that of the angle-weighted normal at the nearest point (Bærentzen, Aanæs 2005),
/// which is right for every closed mesh that does not intersect itself. In double precision; the
/// result depends on the mesh and the point alone.
class ClosestPoints {
 public:
  /// `mesh` in mm, closed and facing outwards, with at least one triangle; see solidMesh.
  explicit ClosestPoints(Mesh mesh);

  /// Returns the point nearest to `p`. `hint` is a triangle that may be near; a good one saves
  /// time.
  [[nodiscard]] ClosestPoint operator()(const openvdb::Vec3d& p, std::uint32_t hint = 0) const;

  [[nodiscard]] const Mesh& mesh() const { return mesh_; }
  /// Unit normal of a triangle; zero if it has no area.
  [[nodiscard]] const openvdb::Vec3d& normal(std::uint32_t triangle) const {
    return normals_[triangle];
  }

 private:
  struct Node {
    std::array<float, 3> low, high;  ///< rounded outwards
    std::uint32_t begin = 0;         ///< of a leaf, in order_; otherwise the second child
    std::uint32_t count = 0;         ///< of a leaf; otherwise zero, and the first child follows
  };
  struct Candidate;

  std::uint32_t build(std::uint32_t begin, std::uint32_t end,
                      const std::vector<openvdb::Vec3d>& centres);
  void findNormals();
  void consider(std::uint32_t triangle, const openvdb::Vec3d& p, Candidate& best) const;

  Mesh mesh_;
  std::vector<openvdb::Vec3d> normals_;         ///< by triangle
  std::vector<openvdb::Vec3d> edge_normals_;    ///< by side, the sum over its two triangles
  std::vector<openvdb::Vec3d> vertex_normals_;  ///< weighted by angle
  std::vector<std::uint32_t> order_;
  std::vector<Node> nodes_;
};

}  // namespace vdbdither
