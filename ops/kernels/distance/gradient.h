#pragma once

#include <array>
#include <cstdint>

#include <openvdb/openvdb.h>

#include "ops/kernels/leaf/leaf_bits.h"
#include "ops/kernels/leaf/leaf_surroundings.h"
#include "vdbdither/model/instruction_set.h"
#include "vdbdither/model/lattice.h"

namespace vdbdither {

/// Computes the unit outward normals of a signed distance, one leaf at a time: the normalised
/// gradient in world space.
///
/// Each component is the central difference over two pitches; if one of the two neighbours is
/// inactive, the one-sided difference over one pitch; if both are, zero. If the gradient is zero (a
/// medial voxel), the normal is the zero vector. All operations are in single precision, that of
/// the distances, in a fixed order, so that a normal has the same bits wherever it is computed.
class LeafNormals {
 public:
  /// `surface` holds distances in mm, < 0 inside. Layers outside `valid` count as inactive.
  LeafNormals(const openvdb::FloatTree& surface, const openvdb::Vec3d& pitch_mm, ZRange valid,
              InstructionSet instructions = bestInstructionSet());

  /// Prepares for the `wanted` voxels of `leaf`, a leaf of `surface`.
  void visit(const FloatLeaf& leaf, const LeafBits& wanted) { around_.visit(leaf, wanted); }

  /// Returns the normal of the active and wanted voxel at `offset` in the leaf.
  [[nodiscard]] openvdb::Vec3s normal(unsigned offset) const;

  /// By component, the normals of eight voxels.
  using Row = std::array<std::array<float, 8>, 3>;
  /// Sets those of `out` whose bit is set in `rows`, rows along z in the order of the leaf that
  /// hold a wanted voxel. The normals of inactive voxels are undefined.
  void makeRows(std::uint64_t rows, Row* out) const { make_rows_(*this, rows, out); }

  /// The distances that the normals are computed from.
  [[nodiscard]] const LeafSurroundings& around() const { return around_; }

 private:
  struct Loops;

  LeafSurroundings around_;
  openvdb::Vec3f per_pitch_;  ///< 1 / pitch, 1/mm
  void (*make_rows_)(const LeafNormals& leaf, std::uint64_t rows, Row* out);
};

/// Returns the normals of every active voxel of `surface` (leaves only) within `core`; zero
/// elsewhere.
openvdb::Vec3SGrid::Ptr outwardNormals(const openvdb::FloatGrid& surface,
                                       const openvdb::Vec3d& pitch_mm, ZRange core, ZRange valid);

/// Returns an empty grid `N`, whose unit vectors in world space transform as normals do.
openvdb::Vec3SGrid::Ptr makeNormalGrid(const openvdb::math::Transform& transform);

}  // namespace vdbdither
