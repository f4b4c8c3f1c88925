#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include <openvdb/math/Mat4.h>

#include "vdbdither/model/mesh.h"
#include "vdbdither/model/openvdb.h"

namespace vdbdither {

/// The surface that a float grid of any tool stands for: where the interpolant of its values passes
/// a level.
///
/// The interpolant goes through the values at the nodes, is a cubic polynomial along each axis
/// through the four nearest of them (trilinear where one of these is inactive) and blends linearly
/// across: continuous everywhere, and for a smooth field of fourth order in the size of the cells.
/// It makes nothing of the values' unit: only where they pass the level counts, so that fog volumes
/// and level sets in index units will do.
class ZeroSet {
 public:
  struct Reading {
    float level = 0;
    bool above = false;  ///< inside is above the level, as in fog, not below
  };
  struct Bounds {
    openvdb::Vec3d min, max;  ///< mm; min > max where there is no surface
  };

  /// `grid`: finite values; inactive ones count as they are. `mm_from_index`: affine, in OpenVDB's
  /// order (a position is a row). `divisions`: into how many parts each cell is split along each
  /// axis, 1 … 8.
  ZeroSet(openvdb::FloatGrid::ConstPtr grid, const openvdb::Mat4d& mm_from_index, Reading reading,
          int divisions);
  ~ZeroSet();

  /// Of the vertices.
  [[nodiscard]] const Bounds& bounds() const { return bounds_; }
  /// How many cells the surface passes, divisions counted.
  [[nodiscard]] double cells() const { return cells_; }
  [[nodiscard]] double memoryBytes() const;

  /// The surface as a closed mesh that faces outwards, by surface nets (S. Gibson, "Constrained
  /// elastic surface nets", 1998): one vertex in each division that it passes, drawn onto it.
  /// Everything that meets [low, high] mm along z is there, and some of what lies beyond, cut open:
  /// the triangles and their order within depend on the grid alone.
  [[nodiscard]] Mesh triangles(double low_mm, double high_mm) const;

  /// Distances to the interpolant itself from those to the mesh. For use by one thread.
  class Feet {
   public:
    explicit Feet(const ZeroSet& surface);
    Feet(Feet&&) noexcept;
    ~Feet();

    /// The signed distance in mm of a position from the surface, negative inside: from the foot
    /// point on the mesh, and the distance to it, by stepping to where the tangent plane at the
    /// foot comes closest. Not farther from `distance_mm` than half a division.
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
  std::vector<openvdb::Coord> blocks_;  ///< origins of the leaf-sized blocks that it passes, sorted
};

}  // namespace vdbdither
