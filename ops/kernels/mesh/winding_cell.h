#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include <openvdb/Types.h>

#include "ops/kernels/mesh/winding_number.h"
#include "vdbdither/model/mesh.h"

namespace vdbdither {

/// The generalized winding number within a cube, for many places in it: of triangles near the cube
/// one by one, of all others a polynomial that has their number and its gradient at the cube's
/// corners (of the third degree and some terms of the fourth and fifth; in the plane, Adini's
/// rectangle). Within 0.002 of WindingNumber::closelyAt, mostly within 0.0001.
class WindingCell {
 public:
  /// What WindingNumber says at a corner.
  struct Corner {
    double number = 0;
    openvdb::Vec3d gradient{0.0};  ///< per mm
  };

  WindingCell() = default;
  /// The cube from `low`. Corner n lies at its upper end along x where n & 1, y: n & 2, z: n & 4.
  WindingCell(const Mesh& mesh, const WindingNumber& winding, const openvdb::Vec3d& low,
              double edge_mm, const std::array<Corner, 8>& corners);

  /// The number at p. `mesh`: the one it was made for.
  [[nodiscard]] double at(const Mesh& mesh, const openvdb::Vec3d& p) const;
  /// How it rises there, per mm; nearly.
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
