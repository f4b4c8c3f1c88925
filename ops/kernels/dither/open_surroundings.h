#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
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

  /// Adds the voxel at `ijk`, an open one of the block, now that it is decided.
  void set(const openvdb::Coord& ijk, float error) {
    const openvdb::Coord at = ijk - lowest_;
    put(columnOf(at), static_cast<std::size_t>(at.z()), error);
  }

  /// Returns Σ q·w over the voxels that are there, as seen from a voxel of the block. In each
  /// column of the kernel, every fourth voxel is added to the same partial sum, so that all
  /// instruction sets give the same bits.
  [[nodiscard]] float sum(const openvdb::Coord& ijk, float depth) const {
    const openvdb::Coord at = ijk - lowest_;
    return sum_(*this, columnOf(at), static_cast<std::size_t>(at.z()), depth);
  }

 private:
  /// Columns along z that are looked at together: four beside each other along y.
  struct Four {
    std::array<std::uint64_t, 4> half;    ///< z of HeightKernel::Column
    std::array<std::uint64_t, 4> window;  ///< the voxels of the column; none if it is idle
    std::ptrdiff_t first;                 ///< the index of the first less that in the middle
  };
  /// Where eight voxels of a column are read, from the lowest within the kernel on.
  struct Eight {
    std::ptrdiff_t apart2;  ///< the index of their first |Δ|² in the kernel
    std::ptrdiff_t voxels;  ///< the index of their first depth and error less that in the middle
  };
  struct Loops;

  void addFours(std::span<const HeightKernel::Column> columns);
  template <bool decided>
  void read(const OpenLeaf& leaf, const openvdb::Coord& from);
  void put(std::size_t column, std::size_t z, float error) {
    present_[column] |= std::uint64_t{1} << z;
    errors_[column * stride_ + z] = error;
  }
  [[nodiscard]] std::size_t columnOf(const openvdb::Coord& at) const {
    return static_cast<std::size_t>(at.x() * edges_.y() + at.y());
  }

  const HeightKernel& kernel_;
  const BlockOrder& order_;
  float (*sum_)(const OpenSurroundings& around, std::size_t column, std::size_t z, float depth);
  openvdb::Coord halo_;  ///< the reach; along z in whole leaves
  openvdb::Coord edges_;
  openvdb::Coord lowest_;               ///< the voxel at the corner of what is held
  std::size_t stride_;                  ///< from column to column
  std::vector<std::uint64_t> present_;  ///< by column along z
  std::vector<float> depths_;
  std::vector<float> errors_;  ///< zero where no voxel is
  bool flat_;                  ///< whether no column of the kernel is longer than two times eight
  std::vector<Four> fours_;
  std::size_t own_ = 0;        ///< the index of those with the column in the middle
  std::vector<Eight> eights_;  ///< two, or eight, for each column
  std::vector<const OpenLeaf*> leaves_;
};

}  // namespace vdbdither
