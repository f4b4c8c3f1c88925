#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include <openvdb/math/Mat4.h>

#include "vdbdither/model/mesh.h"
#include "vdbdither/model/openvdb.h"

namespace vdbdither {

/// The surface that a float grid of any tool represents: where the interpolant of its values passes
/// a level.
///
/// The interpolant has the values of the nodes, is a cubic polynomial along each axis through the
/// nearest four (linear if one of these is inactive), and blends linearly across. It is continuous
/// everywhere, and for a smooth field its error is of fourth order in the size of the cells. The
/// unit of the values does not matter, only where they pass the level, so that fog volumes and
/// level sets in index units can be used.
class ZeroSet {
 public:
  struct Reading {
    float level = 0;
    bool above = false;  ///< values above the level are inside, as in fog, instead of those below
  };
  struct Bounds {
    openvdb::Vec3d min, max;  ///< mm; min > max if there is no surface
  };

  /// The values of `grid` must be finite; inactive ones count like others. `mm_from_index` is
  /// affine, in OpenVDB's order (a position is a row vector). Each cell is split into `divisions`
  /// parts along each axis, 1 … 8.
  ZeroSet(openvdb::FloatGrid::ConstPtr grid, const openvdb::Mat4d& mm_from_index, Reading reading,
          int divisions);
  ~ZeroSet();

  /// The bounds of the vertices.
  [[nodiscard]] const Bounds& bounds() const { return bounds_; }
  /// The number of cells that the surface passes, each division counted.
  [[nodiscard]] double cells() const { return cells_; }
  [[nodiscard]] double memoryBytes() const;

  /// Returns the surface as a mesh that faces outwards, by surface nets (Gibson 1998): one vertex
  /// in each division that the surface passes, moved onto it. The mesh contains every triangle that
  /// meets [low, high] mm along z, and some beyond, where it ends open. The triangles within and
  /// their order depend on the grid alone.
  [[nodiscard]] Mesh triangles(double low_mm, double high_mm) const;

  /// Refines distances to the mesh to distances to the interpolant. For one thread.
  class Feet {
   public:
    explicit Feet(const ZeroSet& surface);
    Feet(Feet&&) noexcept;
    ~Feet();

    /// Returns the signed distance in mm of a position from the surface, negative inside. Starts
    /// with the foot point on the mesh and its distance, and steps to the nearest point of the
    /// tangent plane at the foot. The result differs from `distance_mm` by at most half a division.
    double distanceMm(const openvdb::Vec3d& position_mm, const openvdb::Vec3d& foot_mm,
                      double distance_mm);

   private:
    struct Cache;
    const ZeroSet& surface_;
    std::unique_ptr<Cache> cache_;
  };

 private:
  struct Block;

  [[nodiscard]] std::vector<openvdb::Coord> candidates() const;
  [[nodiscard]] Block blockAt(const openvdb::Coord& origin) const;
  [[nodiscard]] openvdb::Vec3d positionMm(const openvdb::Vec3d& index) const;

  openvdb::FloatGrid::ConstPtr grid_;
  openvdb::Mat4d mm_from_index_;
  openvdb::Mat4d index_from_mm_;
  Reading reading_;
  int divisions_;
  double half_division_mm_ = 0;
  Bounds bounds_;
  double cells_ = 0;
  std::vector<openvdb::Coord>
      blocks_;  ///< origins of the leaf-sized blocks that the surface passes, sorted
};

}  // namespace vdbdither
