#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include <openvdb/math/Coord.h>

#include "ops/kernels/distance/leaf_distances.h"

namespace vdbdither {

/// The winding numbers of the 64 rows along x through a row of leaves, swept from leaf to leaf. A
/// voxel is inside where its number is not zero.
class RowWinding {
 public:
  /// A crossing of visitRowCrossings, to be noted in the leaf that holds the voxel.
  static std::uint32_t pack(const openvdb::Coord& ijk, int delta) {
    return static_cast<std::uint32_t>(
        ((ijk.x() & 7) << 6 | (ijk.y() & 7) << 3 | (ijk.z() & 7)) << 1 | (delta > 0 ? 1 : 0));
  }

  /// The voxels inside in the last plane swept.
  [[nodiscard]] std::uint64_t bits() const { return bits_; }

  /// Sweeps the next leaf, whose crossings are noted at `slot`. Returns its voxels inside.
  LeafBits advance(const LeafDistances& noted, std::size_t slot);

 private:
  void raise(std::uint64_t rows);
  void lower(std::uint64_t rows);

  std::array<std::uint64_t, 16>
      digits_{};            ///< binary digits of the 64 numbers, in two's complement
  std::uint64_t bits_ = 0;  ///< the numbers that are not zero
};

}  // namespace vdbdither
