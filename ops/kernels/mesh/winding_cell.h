#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <openvdb/Types.h>

#include "ops/kernels/mesh/winding_number.h"
#include "vdbdither/model/mesh.h"

namespace vdbdither {

/// The generalized winding number within a cube, for many places in it. Triangles near the cube are
/// summed one by one; all others are represented by a polynomial that has their number and gradient
/// at the cube's corners (third degree with some terms of the fourth and fifth; in the plane,
/// Adini's rectangle). Differs from WindingNumber::closelyAt by at most 0.002, mostly by less than
/// 0.0001.
class WindingCell {
 public:
  /// The number at a corner, as WindingNumber gives it.
  struct Corner {
    double number = 0;
    openvdb::Vec3d gradient{0.0};  ///< per mm
  };

  WindingCell() = default;
  /// The cube with its lowest corner at `low`. Corner n lies at the upper end along x if n & 1,
  /// along y if n & 2, along z if n & 4.
  WindingCell(const Mesh& mesh, const WindingNumber& winding, const openvdb::Vec3d& low,
              double edge_mm, const std::array<Corner, 8>& corners);

  /// How many triangles are summed one by one.
  [[nodiscard]] std::size_t nearTriangles() const { return near_.size(); }
  /// Returns the number at p. `mesh` must be the one that the cell was made for.
  [[nodiscard]] double at(const Mesh& mesh, const openvdb::Vec3d& p) const;
  /// Returns about the gradient at p, per mm.
  [[nodiscard]] openvdb::Vec3d gradientAt(const Mesh& mesh, const openvdb::Vec3d& p) const;

 private:
  [[nodiscard]] openvdb::Vec3d placed(const openvdb::Vec3d& p) const {
    return (p - middle_) / half_mm_;
  }

  openvdb::Vec3d middle_{0.0};
  double half_mm_ = 1;
  std::vector<std::uint32_t> near_;
  std::array<Corner, 8> far_;  ///< of the triangles that are not near
};

}  // namespace vdbdither
