#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include <openvdb/openvdb.h>

#include "vdbdither/model/lattice.h"

namespace vdbdither {

/// The voxels of a layer that belong to a set, one bit each: row after row, `BitLayout::words`
/// words per row, x rising from the lowest bit of the first word.
using BitLayer = std::vector<std::uint64_t>;

/// The layout of a box of voxels in bit layers. On each side of the box, in x and in y, at least
/// one more voxel has a bit, which is never set.
class BitLayout {
 public:
  explicit BitLayout(const openvdb::CoordBBox& box);

  [[nodiscard]] const openvdb::CoordBBox& box() const { return box_; }
  [[nodiscard]] int words() const { return words_; }
  [[nodiscard]] int rows() const { return rows_; }
  [[nodiscard]] int xBegin() const { return x_begin_; }  ///< of bit 0, a multiple of 8
  [[nodiscard]] int yBegin() const { return y_begin_; }  ///< of row 0

  [[nodiscard]] BitLayer emptyLayer() const {
    return BitLayer(static_cast<std::size_t>(words_) * static_cast<std::size_t>(rows_), 0);
  }
  /// The index of a row's first word in a layer.
  [[nodiscard]] std::size_t row(int row) const {
    return static_cast<std::size_t>(row) * static_cast<std::size_t>(words_);
  }

 private:
  openvdb::CoordBBox box_;
  int words_;
  int rows_;
  int x_begin_;
  int y_begin_;
};

/// The values of a scalar grid that count as inside: those below the level (for distances) or above
/// it (for occupancies).
enum class Inside { below, above };

/// Returns one bit layer for each of `layers`: the voxels of the layout's box that are active and
/// true.
std::vector<BitLayer> bitLayers(const openvdb::BoolGrid& grid, const BitLayout& layout,
                                ZRange layers);

/// The same for the voxels, active or not, whose values are below or above `level`.
std::vector<BitLayer> bitLayers(const openvdb::FloatGrid& grid, const BitLayout& layout,
                                ZRange layers, Inside inside, float level);

}  // namespace vdbdither
