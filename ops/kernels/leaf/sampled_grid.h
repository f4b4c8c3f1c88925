#pragma once

#include <memory>

#include <openvdb/math/Mat4.h>

#include "vdbdither/model/openvdb.h"

namespace vdbdither {

/// A grid of numbers or vectors on a lattice of its own, as values on another one. A sample is
/// the trilinear mean of those of the eight nodes around it that are active; where none is, there
/// is no value.
class SampledGrid {
 public:
  /// Whether `grid` is of numbers (float, double) or of vectors (vec3s, vec3d).
  static bool takes(const openvdb::GridBase& grid);

  /// @param grid           one that `takes` accepts
  /// @param mm_from_index  affine, in OpenVDB's order (a position is a row vector), with an inverse
  SampledGrid(openvdb::GridBase::ConstPtr grid, const openvdb::Mat4d& mm_from_index);

  /// Returns a grid of float or vec3s with the samples at the active voxels of `surface` that lie
  /// inside or up to `outside_mm` outside. All other voxels are 0 and inactive. Depends on each
  /// voxel alone.
  /// @param surface   signed distances, mm; index (i, j, k) lies at the product with `pitch_mm`
  [[nodiscard]] openvdb::GridBase::Ptr run(const openvdb::FloatGrid& surface,
                                           const openvdb::Vec3d& pitch_mm, double outside_mm) const;

  [[nodiscard]] double memoryBytes() const;

 private:
  openvdb::GridBase::ConstPtr grid_;
  openvdb::Mat4d index_from_mm_;
};

}  // namespace vdbdither
