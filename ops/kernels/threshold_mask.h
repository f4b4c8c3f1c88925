#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include <openvdb/openvdb.h>

namespace vdbdither {

/// Thresholds M in (0, 1), a function of the absolute voxel index alone.
class ThresholdMask {
 public:
  /// A tile repeated in all directions. `size`: voxels per axis; `values`: size.x · size.y · size.z
  /// of them, z fastest.
  ThresholdMask(const openvdb::Coord& size, std::span<const float> values);

  /// The tile of a grid `mask`: active voxels from (0, 0, 0) on that fill a box. Throws DataError
  /// where they do not, or where a value is not within (0, 1).
  static ThresholdMask fromGrid(const openvdb::FloatGrid& grid);

  /// White noise: uniform and independent per voxel, a hash of index and seed.
  static ThresholdMask whiteNoise(std::uint64_t seed);

  /// The same threshold everywhere.
  static ThresholdMask constant(float value) { return {openvdb::Coord(1), {&value, 1}}; }

  [[nodiscard]] std::size_t bytes() const { return values_.size() * sizeof(float); }

  /// M at an absolute index, negative ones included.
  [[nodiscard]] float operator()(const openvdb::Coord& ijk) const;

 private:
  ThresholdMask() = default;

  /// Where the tile holds voxel `ijk`: in blocks of 8³ laid out as leaves are, since it is read
  /// leaf by leaf.
  [[nodiscard]] std::size_t index(const openvdb::Coord& ijk) const;

  openvdb::Coord size_;
  openvdb::Coord blocks_;
  std::vector<float> values_;  ///< empty: white noise
  std::uint64_t seed_ = 0;
};

}  // namespace vdbdither
