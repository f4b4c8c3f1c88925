#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include <openvdb/math/BBox.h>
#include <openvdb/math/Vec3.h>

#include "vdbdither/mesh.h"

namespace vdbdither {

/// The solid angle of a triangle seen from p, positive where its corners turn clockwise there: from
/// the inside of a solid whose triangles are counter-clockwise seen from outside (van Oosterom and
/// Strackee 1983). Zero in the triangle's plane.
double solidAngle(const std::array<openvdb::Vec3d, 3>& corners, const openvdb::Vec3d& p);

/// The generalized winding number of any set of triangles (Jacobson, Kavan, Sorkine-Hornung 2013):
/// 1 inside a closed surface and 0 outside, ½ on it; fractions where it is open.
class WindingNumber {
 public:
  /// `mesh` is kept by reference.
  explicit WindingNumber(const Mesh& mesh);

  /// From every triangle, in double.
  [[nodiscard]] double exactAt(const openvdb::Vec3d& p) const;

  /// Groups of triangles far from p count as one dipole (Barill et al., "Fast winding numbers for
  /// soups and clouds", 2018), near ones one by one. Within 0.02 of the exact number.
  [[nodiscard]] double at(const openvdb::Vec3d& p) const;

 private:
  struct Node {
    openvdb::Vec3d centre;     ///< by area
    openvdb::Vec3d area;       ///< sum of the triangles' vector areas
    double radius;             ///< of what the triangles take about the centre
    std::uint32_t begin, end;  ///< of `order_`
    std::uint32_t second;      ///< the other half's node, the first follows; 0 for a leaf
  };

  [[nodiscard]] std::array<openvdb::Vec3d, 3> corners(std::uint32_t triangle) const;
  std::uint32_t build(std::uint32_t begin, std::uint32_t end);

  const Mesh& mesh_;
  std::vector<openvdb::Vec3d> middles_;  ///< of the triangles' boxes, while it is built
  std::vector<std::uint32_t> order_;
  std::vector<Node> nodes_;
};

}  // namespace vdbdither
