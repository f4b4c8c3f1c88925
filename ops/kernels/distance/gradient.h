#pragma once

#include <array>

#include <openvdb/openvdb.h>

#include "ops/kernels/leaf/leaf_bits.h"
#include "ops/kernels/leaf/leaf_surroundings.h"
#include "vdbdither/model/lattice.h"

namespace vdbdither {

/// The unit outward normals of a signed distance, one leaf at a time: the normalised gradient in
/// world space.
///
/// Each component is the central difference over two pitches; where one of the two neighbours is
/// inactive, the one-sided difference over one pitch; where both are, zero. Where the whole
/// gradient is zero (a medial voxel) no direction is better than another, and the normal is the
/// zero vector. Single precision throughout, the precision of the distances, in a fixed order: the
/// same bits wherever a normal is asked for.
class LeafNormals {
 public:
  /// `surface`: distances in mm, < 0 inside. `valid`: layers outside it count as inactive.
  LeafNormals(const openvdb::FloatTree& surface, const openvdb::Vec3d& pitch_mm, ZRange valid);

  /// Turns to the `wanted` voxels of `leaf`, a leaf of `surface`.
  void visit(const FloatLeaf& leaf, const LeafBits& wanted) { around_.visit(leaf, wanted); }

  /// The normal of the active voxel at `offset` in the leaf, a wanted one.
  [[nodiscard]] openvdb::Vec3s normal(unsigned offset) const;

  /// The normals of the eight voxels from `offset` on, a row along z that holds a wanted one, by
  /// component. Those of inactive voxels mean nothing.
  using Row = std::array<std::array<float, 8>, 3>;
  [[nodiscard]] Row row(unsigned offset) const;

  /// The distances that they are made of.
  [[nodiscard]] const LeafSurroundings& around() const { return around_; }

 private:
  LeafSurroundings around_;
  openvdb::Vec3f per_pitch_;  ///< 1 / pitch, 1/mm
};

/// The normals of every active voxel of `surface` (leaves only) within `core`; zero elsewhere.
openvdb::Vec3SGrid::Ptr outwardNormals(const openvdb::FloatGrid& surface,
                                       const openvdb::Vec3d& pitch_mm, ZRange core, ZRange valid);

/// An empty grid `N`: a unit vector in world space that transforms as normals do.
openvdb::Vec3SGrid::Ptr makeNormalGrid(const openvdb::math::Transform& transform);

}  // namespace vdbdither
