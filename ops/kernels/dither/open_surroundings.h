#pragma once

#include <cstddef>
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

  /// Returns Σ q·w over the voxels that are there, as seen from a voxel of the block. In each
  /// column of the kernel, every fourth voxel is added to the same partial sum, so that all
  /// instruction sets give the same bits.
  [[nodiscard]] float sum(const openvdb::Coord& ijk, float depth);

 private:
  /// A column of the kernel, as seen from the column in its middle.
  struct Seen {
    int column;            ///< its index less that in the middle
    std::uint32_t apart2;  ///< the index of its first |Δ|² in the kernel
    int half;              ///< z of HeightKernel::Column
  };
  /// The columns around one column that hold voxels, and that one. They are read by groups of eight
  /// voxels from the lowest within the kernel on. Eight columns are looked at at a time.
  struct Near {
    explicit Near(std::size_t columns);
    std::size_t middle;                  ///< the column around which they are
    std::size_t own = 0;                 ///< its place among them
    int own_half = 0;                    ///< the half of that column
    std::size_t count = 0;               ///< rounded up to eight
    std::vector<std::uint64_t> present;  ///< bit z: the lowest voxel for a sum at z
    std::vector<std::uint64_t> window;   ///< the voxels of a sum at 0
    std::vector<std::ptrdiff_t> voxels;  ///< index of the depth and error of the lowest for 0
    std::vector<std::uint32_t> apart2;
  };
  struct Loops;

  void clear();
  void read(const OpenLeaf& leaf, const openvdb::Coord& from);
  void lookAround(std::size_t column);
  [[nodiscard]] std::size_t columnOf(int x, int y) const {
    return static_cast<std::size_t>(x * edges_.y() + y);
  }

  const HeightKernel& kernel_;
  const BlockOrder& order_;
  float (*sum_)(const OpenSurroundings& around, unsigned z, float depth);
  openvdb::Coord reach_;
  openvdb::Coord edges_;
  openvdb::Coord lowest_;               ///< the voxel at the corner of what is held
  std::size_t stride_;                  ///< from column to column
  std::vector<std::uint64_t> present_;  ///< by column along z
  std::vector<float> depths_;
  std::vector<float> errors_;  ///< zero where no voxel is
  std::vector<Seen> seen_;
  Near near_;
};

}  // namespace vdbdither
