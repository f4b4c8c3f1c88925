#pragma once

#include <cstdint>
#include <vector>

#include <openvdb/openvdb.h>

#include "ops/kernels/dither/block_order.h"
#include "ops/kernels/dither/height_kernel.h"
#include "ops/kernels/dither/open_voxels.h"
#include "vdbdither/model/instruction_set.h"

namespace vdbdither {

/// The open voxels of a block and of those around it, within the reach of a kernel, for sums over
/// their errors.
class OpenSurroundings {
 public:
  OpenSurroundings(const HeightKernel& kernel, const BlockOrder& order,
                   InstructionSet instructions = bestInstructionSet());

  /// Moves to `block` and reads the decided voxels in and around it.
  void visit(OpenLeaves::Block block, OpenLeaves::Finder& find);

  /// Adds the decided voxel at `ijk`, which lies in the block, or replaces it.
  void set(const openvdb::Coord& ijk, const OpenVoxel& voxel);

  /// Returns Σ q·w over the voxels that are there, as seen from a voxel of the block. The bits are
  /// the same with every instruction set: voxels are added up by the remainder of their place in
  /// the column of the kernel, by four.
  [[nodiscard]] float sum(const openvdb::Coord& ijk, float depth);

 private:
  /// A column of the kernel that holds voxels, as seen from a row along z of the block.
  struct Near {
    const std::uint64_t* present;
    std::uint32_t first;   ///< the index of its depths and errors
    std::uint32_t apart2;  ///< the index of its first |Δ|² in the kernel
    unsigned half;         ///< z of HeightKernel::Column
  };
  /// Voxels of a column that are added up together: indices of the first.
  struct Group {
    std::uint32_t voxels;
    std::uint32_t apart2;
  };
  struct Loops;

  void clear();
  void read(const OpenLeaf& leaf, const openvdb::Coord& from);
  void lookAround(int x, int y);
  [[nodiscard]] std::size_t columnOf(int x, int y) const {
    return static_cast<std::size_t>(x * edges_.y() + y);
  }

  const HeightKernel& kernel_;
  const BlockOrder& order_;
  float (*sum_)(OpenSurroundings& around, unsigned z, float depth);
  openvdb::Coord reach_;
  openvdb::Coord edges_;
  openvdb::Coord lowest_;               ///< the voxel at the corner of what is held
  std::size_t stride_;                  ///< from column to column
  std::vector<std::uint64_t> present_;  ///< by column along z
  std::vector<float> depths_;
  std::vector<float> errors_;  ///< zero where no voxel is
  std::size_t own_column_;     ///< that `near_` belongs to
  std::vector<Near> near_;     ///< the columns around it that hold voxels, and itself
  std::size_t near_count_ = 0;
  std::vector<Group> groups_;  ///< those of the sum that is being made
};

}  // namespace vdbdither
