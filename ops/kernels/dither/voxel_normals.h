#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include <openvdb/openvdb.h>

#include "ops/kernels/distance/gradient.h"
#include "ops/kernels/leaf/leaf_bits.h"
#include "ops/kernels/leaf/leaf_surroundings.h"
#include "vdbdither/model/instruction_set.h"
#include "vdbdither/model/lattice.h"

namespace vdbdither {

using NormalAccessor = openvdb::tree::ValueAccessor<const openvdb::Vec3STree, false>;

/// The normals of one leaf's voxels: those given, or those of the gradient, computed row by row on
/// demand.
class VoxelNormals {
 public:
  /// \param surface  distances in mm
  /// \param given  the normals, or null to use the gradient
  /// \param valid  the layers that can be read
  VoxelNormals(const openvdb::FloatTree& surface, const openvdb::Vec3d& pitch_mm,
               const openvdb::Vec3STree* given, ZRange valid,
               InstructionSet instructions = bestInstructionSet());

  /// Prepares for the `wanted` voxels of `leaf`.
  void visit(const FloatLeaf& leaf, const LeafBits& wanted);

  /// The distances in the leaf and around it.
  const LeafSurroundings& around();

  /// Returns the normal of the active voxel at `offset`.
  openvdb::Vec3s operator()(unsigned offset) {
    if (given_) return given_->getValue(leaf_->offsetToGlobalCoord(offset));
    const std::uint64_t bit = std::uint64_t{1} << offset / 8;
    if ((rows_made_ & bit) == 0) makeRows(bit);
    const LeafNormals::Row& row = rows_[offset / 8];
    return {row[0][offset % 8], row[1][offset % 8], row[2][offset % 8]};
  }

  /// Returns those of `undecided` that are within `reach`·k_D of the surface along their normal,
  /// and perhaps others.
  LeafBits within(const LeafBits& undecided, double reach);

 private:
  struct Loops;

  /// Makes those of the rows that are not made yet.
  void makeRows(std::uint64_t rows);

  LeafNormals gradient_;
  std::optional<NormalAccessor> given_;
  openvdb::Vec3f per_pitch_;
  LeafBits (*within_)(const VoxelNormals& normals, const LeafBits& undecided, float limit);
  const FloatLeaf* leaf_ = nullptr;
  LeafBits wanted_{};
  bool visited_ = false;
  std::uint64_t rows_made_ = 0;  ///< one bit per row along z, in the order of the leaf
  std::array<LeafNormals::Row, 64> rows_{};
};

}  // namespace vdbdither
