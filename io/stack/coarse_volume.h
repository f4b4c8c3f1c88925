#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include <openvdb/math/Vec3.h>

#include "vdbdither/model/span_image.h"

namespace vdbdither {

/// A stack of slices in cubes of equal edges, for views of the whole part. Gathered layer by layer.
class CoarseVolume {
 public:
  /// The longest side has this many cubes, or as many as it has of the longest edge of a voxel.
  static constexpr int most_cells = 256;

  /// @param size      of the stack in voxels
  /// @param pitch_mm  of the voxels
  /// @param colours   of the values of pixels from 1 on
  CoarseVolume(const std::array<std::uint32_t, 3>& size, const openvdb::Vec3d& pitch_mm,
               std::vector<std::array<std::uint8_t, 4>> colours);

  /// Adds layer `z`, counted from 0. Layers come in rising order; missing ones are empty.
  void add(std::uint32_t z, const SpanImage& slice);

  [[nodiscard]] double cellMm() const { return cell_mm_; }
  [[nodiscard]] const std::array<std::uint32_t, 3>& cells() const { return cells_; }

  /// Blocks of two cubes along each axis, which have a colour.
  [[nodiscard]] std::array<std::uint32_t, 3> blocks() const {
    return {(cells_[0] + 1) / 2, (cells_[1] + 1) / 2, (cells_[2] + 1) / 2};
  }

  /// Returns three fields of bytes, in each of which x runs fastest, then the rows, top row first,
  /// then the layers: the share of a cube that is not 0, in steps of 17 from 0 to 255; the value
  /// that most of it has besides 0; and of each block red, green and blue: the mean of what is not
  /// 0, as light of a gamma of 2, and 0 only where there is nothing. Ends the gathering.
  [[nodiscard]] std::vector<std::uint8_t> finish();

 private:
  void endCellLayer();
  void endBlockLayer();

  std::vector<std::array<std::uint8_t, 4>> colours_;
  std::size_t values_;
  double cell_mm_;
  std::array<std::uint32_t, 3> cells_;
  std::array<std::vector<std::uint32_t>, 3> cell_of_;  ///< of each column, row and layer
  std::array<std::vector<std::uint32_t>, 3> begin_;    ///< of each cell and after the last
  std::uint32_t layer_ = 0;                            ///< of cells, which is gathered
  std::vector<std::uint32_t> counts_;                  ///< of its cells and values
  /// Of the blocks that are gathered: sums of the squares of red, green and blue, and of voxels.
  std::vector<std::array<std::uint64_t, 4>> light_;
  std::vector<std::uint8_t> share_, value_, colour_;
};

}  // namespace vdbdither
