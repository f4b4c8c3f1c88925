#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include <openvdb/math/Coord.h>

#include "ops/kernels/distance/leaf_distances.h"

namespace vdbdither {

/// The winding numbers of the 64 rows of a row of leaves, swept along x.
class RowWinding {
 public:
  static std::uint32_t pack(const openvdb::Coord& ijk, int delta) {
    return static_cast<std::uint32_t>(
        ((ijk.x() & 7) << 6 | (ijk.y() & 7) << 3 | (ijk.z() & 7)) << 1 | (delta > 0 ? 1 : 0));
  }

  /// The inside of the last plane.
  [[nodiscard]] std::uint64_t bits() const { return bits_; }

  /// The inside of the next leaf, at `slot`, where crossings were noted.
  LeafBits advance(const LeafDistances& noted, std::size_t slot);

 private:
  void raise(std::uint64_t rows);
  void lower(std::uint64_t rows);

  std::array<std::uint64_t, 16> digits_{};  ///< of the 64 numbers, in two's complement
  std::uint64_t bits_ = 0;                  ///< those that are not zero
};

}  // namespace vdbdither
