#pragma once

// The mask family: kernels that make threshold masks, read them and measure their spectra.

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include <openvdb/openvdb.h>

namespace vdbdither {

/// Thresholds M in (0, 1), a function of the absolute voxel index alone.
class ThresholdMask {
 public:
  /// A tile of `size` voxels, repeated in all directions. `values` are size.x · size.y · size.z
  /// thresholds, z fastest.
  ThresholdMask(const openvdb::Coord& size, std::vector<float> values);

  /// The tile of a grid `mask`, whose active voxels fill a box that begins at (0, 0, 0). Throws
  /// DataError if they do not, or if a value is not within (0, 1).
  explicit ThresholdMask(const openvdb::FloatGrid& grid);

  /// White noise: uniform and independent for each voxel, a hash of index and seed.
  static ThresholdMask whiteNoise(std::uint64_t seed);

  /// The same threshold everywhere.
  static ThresholdMask constant(float value) { return {openvdb::Coord(1), {value}}; }

  /// The period along each axis, and the thresholds of one period, z fastest; 0 and none of white
  /// noise.
  [[nodiscard]] openvdb::Coord size() const;
  [[nodiscard]] std::span<const float> values() const { return values_; }

  [[nodiscard]] std::size_t bytes() const { return values_.size() * sizeof(float); }

  /// Returns M at an absolute index, which may be negative.
  [[nodiscard]] float operator()(const openvdb::Coord& ijk) const;

  /// Sets `thresholds` to those of voxels on top of each other, the lowest at `ijk`.
  void column(const openvdb::Coord& ijk, std::span<float> thresholds) const;

 private:
  ThresholdMask() = default;

  struct Axis {
    std::size_t operator()(int index) const;
    int period = 1;
    int low_bits =
        0;  ///< mask of an index within the period; 0 if the period is not a power of two
    std::size_t step = 1;
  };
  void repeat(const openvdb::Coord& size);

  std::array<Axis, 3> axes_;
  std::vector<float> values_;  ///< empty: white noise
  std::uint64_t seed_ = 0;
};

}  // namespace vdbdither
