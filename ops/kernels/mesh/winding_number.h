#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include <openvdb/math/BBox.h>
#include <openvdb/math/Vec3.h>

#include "vdbdither/model/mesh.h"

namespace vdbdither {

/// Returns the solid angle of a triangle seen from p (van Oosterom and Strackee 1983): positive
/// where its corners turn clockwise, as seen from inside a solid whose triangles are
/// counter-clockwise from outside; zero in the triangle's plane.
double solidAngle(const std::array<openvdb::Vec3d, 3>& corners, const openvdb::Vec3d& p);

/// The generalized winding number of some triangles of a mesh, summed one by one, and its gradient
/// at p per mm (the magnetic field of currents along the triangles' sides). `p` must not lie on a
/// side.
double windingOf(const Mesh& mesh, std::span<const std::uint32_t> triangles,
                 const openvdb::Vec3d& p);
openvdb::Vec3d windingGradientOf(const Mesh& mesh, std::span<const std::uint32_t> triangles,
                                 const openvdb::Vec3d& p);

inline std::array<openvdb::Vec3d, 3> cornersOf(const Mesh& mesh, std::uint32_t triangle) {
  const Mesh::Triangle& t = mesh.triangles[triangle];
  return {mesh.vertices[t[0]], mesh.vertices[t[1]], mesh.vertices[t[2]]};
}

/// The generalized winding number of any set of triangles (Jacobson, Kavan, Sorkine-Hornung 2013):
/// 1 inside a closed surface and 0 outside, ½ on it; fractions where it is open.
///
/// Groups of triangles far from a point count as a dipole with its first and second derivatives
/// (Barill et al. 2018); near triangles count one by one.
class WindingNumber {
 public:
  /// Keeps a reference to `mesh`.
  explicit WindingNumber(const Mesh& mesh);

  /// Sums over every triangle, in double precision.
  [[nodiscard]] double exactAt(const openvdb::Vec3d& p) const;

  /// Returns the number to within 0.01, mostly within 0.001.
  [[nodiscard]] double at(const openvdb::Vec3d& p) const { return sum(p, rough_radii); }

  /// Returns the number to within 0.0005, mostly within 0.0001.
  [[nodiscard]] double closelyAt(const openvdb::Vec3d& p) const { return sum(p, close_radii); }

  /// How many triangles and groups `closelyAt` looks at.
  [[nodiscard]] std::size_t workAt(const openvdb::Vec3d& p) const;

  /// Returns the gradient at p per mm, mostly to within some thousandths. `p` must not lie on a
  /// side of a triangle.
  [[nodiscard]] openvdb::Vec3d gradientAt(const openvdb::Vec3d& p) const;

  /// Calls work(triangle) for all triangles within `distance_mm` of p and for some others, in an
  /// order that depends on the mesh alone.
  template <class Work>
  void forEachWithin(const openvdb::Vec3d& p, double distance_mm, const Work& work) const {
    std::vector<std::uint32_t> waiting;
    if (!nodes_.empty()) waiting.push_back(0);
    while (!waiting.empty()) {
      const std::uint32_t index = waiting.back();
      waiting.pop_back();
      const Node& node = nodes_[index];
      const double reach_mm = node.radius + distance_mm;
      if ((node.centre - p).lengthSqr() > reach_mm * reach_mm) continue;
      if (node.other == 0) {
        for (std::uint32_t i = node.begin; i < node.end; ++i) work(order_[i]);
      } else {
        waiting.insert(waiting.end(), {node.other, index + 1});
      }
    }
  }

  /// Returns a number on the same side of ½ and of −½ as the exact number, computed only as
  /// accurately as this needs.
  [[nodiscard]] double judgedAt(const openvdb::Vec3d& p) const;

 private:
  /// The distance, in radii, from which a group counts as a dipole.
  static constexpr double rough_radii = 2;
  static constexpr double close_radii = 4;

  /// Moments of the vector areas a of a group's triangles about its centre; x is the place of each.
  struct Node {
    openvdb::Vec3d centre;          ///< by area
    openvdb::Vec3d area;            ///< ∑ a
    std::array<double, 6> first;    ///< ∑ a xᵀ, made symmetric: xx yy zz xy xz yz
    openvdb::Vec3d second_trace;    ///< ∑ 2 (a·x) x + (x·x) a
    std::array<double, 10> second;  ///< ∑ a x x, symmetric: xxx yyy zzz xxy xxz yyx yyz zzx zzy xyz
    double radius;                  ///< of a sphere about the centre that holds the triangles
    std::uint32_t begin, end;       ///< of `order_`
    std::uint32_t
        other;  ///< the node of the second half; that of the first half follows; 0 for a leaf
    std::uint32_t corners;  ///< of a leaf, in `leaf_corners_`
  };
  static constexpr std::uint32_t triangles_per_leaf = 8;
  /// The corners of a leaf's triangles, by corner and axis, so that several are computed at once.
  using LeafCorners = std::array<std::array<double, triangles_per_leaf>, 9>;

  [[nodiscard]] std::array<openvdb::Vec3d, 3> corners(std::uint32_t triangle) const {
    return cornersOf(mesh_, triangle);
  }
  [[nodiscard]] std::span<const std::uint32_t> trianglesOf(const Node& node) const {
    return {order_.data() + node.begin, node.end - node.begin};
  }
  [[nodiscard]] Node nodeOf(std::uint32_t begin, std::uint32_t end) const;
  std::uint32_t build(std::uint32_t begin, std::uint32_t end);
  /// Calls far(node, r), with r from p to the centre, for groups that count as a dipole, and
  /// near(node) for leaves that do not.
  template <class Far, class Near>
  void forEach(const openvdb::Vec3d& p, double far_radii, const Far& far, const Near& near) const;
  [[nodiscard]] double sum(const openvdb::Vec3d& p, double far_radii) const;

  const Mesh& mesh_;
  std::vector<openvdb::Vec3d> middles_;  ///< of the triangles, while the tree is built
  std::vector<std::uint32_t> order_;
  std::vector<Node> nodes_;
  std::vector<LeafCorners> leaf_corners_;
};

}  // namespace vdbdither
