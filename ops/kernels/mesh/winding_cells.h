#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include <openvdb/Types.h>
#include <openvdb/math/BBox.h>

#include "ops/kernels/mesh/grid_keys.h"
#include "ops/kernels/mesh/winding_cell.h"
#include "ops/kernels/mesh/winding_number.h"
#include "vdbdither/model/mesh.h"

namespace vdbdither {

/// The generalized winding number of a mesh in a grid of cells. Places on the grid are counted in
/// units; the edge of a cell is `units` long.
class WindingCells {
 public:
  static constexpr int units = 32;

  /// \param mesh           must outlive the cells
  /// \param winding        of the mesh; must outlive the cells
  /// \param bounds         bounding box of the mesh
  /// \param along_longest  how many cells there are along the longest side of the box
  WindingCells(const Mesh& mesh, const WindingNumber& winding,
               const openvdb::math::BBox<openvdb::Vec3d>& bounds, int along_longest);

  /// Returns the cells with these lowest corners, which it makes if they do not exist.
  std::vector<std::uint32_t> at(const std::vector<openvdb::Coord>& lows);
  /// About how many triangles `at` looks at to make cells, estimated from some of them.
  [[nodiscard]] std::size_t workOfMaking(std::span<const openvdb::Coord> lows) const;

  /// Returns the number at a place in a cell.
  [[nodiscard]] double numberAt(std::uint32_t cell, const openvdb::Vec3d& p) const {
    return cells_[cell].at(mesh_, p);
  }
  /// Returns a number on the right side of ½ and −½.
  [[nodiscard]] double judgedAt(std::uint32_t cell, const openvdb::Vec3d& p) const {
    const double number = numberAt(cell, p);
    return isDoubtful(number) ? winding_.judgedAt(p) : number;
  }
  /// About how many triangles `judgedAt` looks at to return a number in a cell.
  [[nodiscard]] std::size_t workOfJudging(std::uint32_t cell, double number) const {
    constexpr std::size_t of_far_triangles = 8;
    return cells_[cell].nearTriangles() + of_far_triangles +
           (isDoubtful(number) ? mesh_.triangles.size() : 0);
  }
  /// Returns about the gradient at a place in a cell, per mm.
  [[nodiscard]] openvdb::Vec3d gradientAt(std::uint32_t cell, const openvdb::Vec3d& p) const {
    return cells_[cell].gradientAt(mesh_, p);
  }
  [[nodiscard]] const Mesh& mesh() const { return mesh_; }
  [[nodiscard]] double longestMm() const { return longest_mm_; }
  [[nodiscard]] double unitMm() const { return unit_mm_; }
  /// Returns the position of a place on the grid, mm.
  [[nodiscard]] openvdb::Vec3d position(const openvdb::Coord& corner) const {
    return origin_mm_ + corner.asVec3d() * unit_mm_;
  }
  /// The places on the grid beyond which everything counts as outside.
  [[nodiscard]] const openvdb::CoordBBox& limits() const { return limits_; }

 private:
  [[nodiscard]] static bool isDoubtful(double number) {
    constexpr double doubt = 1e-3;
    return std::abs(std::abs(number) - 0.5) < doubt;
  }

  const Mesh& mesh_;
  const WindingNumber& winding_;
  double longest_mm_, unit_mm_;
  openvdb::Vec3d origin_mm_;
  openvdb::CoordBBox limits_;
  KeyMap<WindingCell::Corner> corners_;
  KeyMap<std::uint32_t> cell_at_;
  std::vector<WindingCell> cells_;
};

}  // namespace vdbdither
