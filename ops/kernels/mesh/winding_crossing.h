#pragma once

#include <cstdint>
#include <span>

#include <openvdb/Types.h>

#include "ops/kernels/mesh/derived_mesh.h"
#include "ops/kernels/mesh/winding_cells.h"

namespace vdbdither {

/// The solid of a winding surface: where the generalized winding number exceeds ½.
class WindingSolid {
 public:
  /// With `side` −1 the solid is where the number is below −½: that of triangles which face
  /// inwards. The cells must outlive the solid.
  WindingSolid(WindingCells& cells, double side) : cells_(cells), side_(side) {}

  /// The number times `side` at a place in a cell; `judgedAt` is on the right side of ½.
  [[nodiscard]] double numberAt(std::uint32_t cell, const openvdb::Vec3d& p) const {
    return side_ * cells_.numberAt(cell, p);
  }
  [[nodiscard]] double judgedAt(std::uint32_t cell, const openvdb::Vec3d& p) const {
    return side_ * cells_.judgedAt(cell, p);
  }
  [[nodiscard]] double side() const { return side_; }
  [[nodiscard]] WindingCells& cells() const { return cells_; }

 private:
  WindingCells& cells_;
  double side_;
};

/// The cube of an octree leaf, mm.
struct LeafCube {
  openvdb::Vec3d low;
  double size_mm;

  /// The point of the cube nearest to p, kept clear of the faces.
  [[nodiscard]] openvdb::Vec3d within(openvdb::Vec3d p) const;
};

/// Where an edge of a leaf crosses the surface.
struct EdgeCrossing {
  openvdb::Vec3d at{0.0};
  openvdb::Vec3d normal{0.0};          ///< unit, in either direction; zero where it is unknown
  std::uint32_t triangle = no_source;  ///< that the edge pierces there; no_source between triangles
  std::uint8_t passes = 0;  ///< 0 for an edge that does not cross it, 2 for several crossings
  bool is_smooth = false;   ///< between triangles, where the number is ½
  std::uint32_t looks = 0;  ///< at how many places the number was found
};

/// An edge of a leaf, and what is known of it.
struct LeafEdge {
  openvdb::Vec3d from;  ///< its lower end, mm
  int axis;
  double size_mm;
  bool low_is_inside, high_is_inside;        ///< its ends
  std::uint32_t cell;                        ///< that the edge lies in
  std::span<const std::uint32_t> triangles;  ///< that meet the leaf, among others those it pierces
};

/// Finds the first crossing of an edge. Two crossings closer than the thinnest wall cancel.
EdgeCrossing crossingOf(const WindingSolid& solid, const LeafEdge& edge);

/// Returns the point of the cube with the minimum sum of squared distances to the tangent planes at
/// the crossings; along directions that these do not determine, the mean of the crossings.
openvdb::Vec3d meetingPoint(const LeafCube& cube, std::span<const EdgeCrossing> crossings);

}  // namespace vdbdither
