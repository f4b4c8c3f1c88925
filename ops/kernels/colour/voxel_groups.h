#pragma once

#include <openvdb/Types.h>

#include "ops/kernels/leaf/floor_divided.h"
#include "vdbdither/model/lattice.h"

namespace vdbdither {

/// Boxes of voxels that one search serves, made at the middle of each. They are the largest whose
/// voxels all lie less than half of the longest edge of a voxel from there. The box of index 0
/// begins at voxel 0. Sizes along x and y are powers of two up to 8, so that a box meets one column
/// of leaves.
class VoxelGroups {
 public:
  explicit VoxelGroups(const openvdb::Vec3d& pitch_mm);

  [[nodiscard]] int xOf(int x) const { return x >> x_bits_; }
  [[nodiscard]] int yOf(int y) const { return y >> y_bits_; }
  [[nodiscard]] int zOf(int z) const { return floorDivided(z, layers_); }
  [[nodiscard]] openvdb::Coord size() const { return {1 << x_bits_, 1 << y_bits_, layers_}; }

  /// Returns the voxels of a box of groups.
  [[nodiscard]] openvdb::CoordBBox voxelsOf(const openvdb::CoordBBox& groups) const;

  /// Returns the lattice of the middles, for the groups of all of its voxels.
  [[nodiscard]] Lattice middlesOf(const Lattice& voxels) const;

  /// Returns how far a voxel may lie from the middle of its group.
  [[nodiscard]] double offMm() const { return off_mm_; }

 private:
  int x_bits_ = 0;
  int y_bits_ = 0;
  int layers_ = 1;
  double off_mm_ = 0;
};

}  // namespace vdbdither
