#include "ops/kernels/mask/threshold_mask.h"

#include <bit>
#include <cassert>
#include <string>
#include <utility>

#include <openvdb/tools/Dense.h>

#include "vdbdither/model/errors.h"
#include "vdbdither/model/split_mix.h"

namespace vdbdither {

using openvdb::Coord;

namespace {

std::string text(const Coord& ijk) {
  return std::to_string(ijk.x()) + "," + std::to_string(ijk.y()) + "," + std::to_string(ijk.z());
}

}  // namespace

/// Returns the offset in `values_` along one axis of the tile.
inline std::size_t ThresholdMask::Axis::operator()(int index) const {
  if (low_bits != 0) return step * static_cast<std::size_t>(index & low_bits);
  const int rest = index % period;
  return step * static_cast<std::size_t>(rest < 0 ? rest + period : rest);
}

ThresholdMask::ThresholdMask(const Coord& size, std::vector<float> values)
    : values_(std::move(values)) {
  repeat(size);
}

void ThresholdMask::repeat(const Coord& size) {
  std::size_t step = 1;
  for (const int axis : {2, 1, 0}) {
    const int period = size[axis];
    const bool masks = std::has_single_bit(static_cast<unsigned>(period));
    axes_[static_cast<std::size_t>(axis)] = {period, masks ? period - 1 : 0, step};
    step *= static_cast<std::size_t>(period);
  }
  assert(values_.size() == step);
}

ThresholdMask::ThresholdMask(const openvdb::FloatGrid& grid) {
  const openvdb::CoordBBox box = grid.evalActiveVoxelBoundingBox();
  if (box.empty()) throw DataError("a mask needs active voxels, and there are none");
  if (box.min() != Coord(0) || box.volume() != grid.activeVoxelCount()) {
    throw DataError("a mask is a box of active voxels from index 0,0,0 on; here " +
                    std::to_string(grid.activeVoxelCount()) + " are active from " +
                    text(box.min()) + " to " + text(box.max()));
  }
  values_.resize(box.volume());
  openvdb::tools::Dense<float, openvdb::tools::LayoutZYX> dense(box, values_.data());
  openvdb::tools::copyToDense(grid, dense);
  for (const float value : values_) {
    if (!(value > 0.0F && value < 1.0F)) {
      throw DataError("a mask holds thresholds between 0 and 1, exclusive; here one is " +
                      std::to_string(value));
    }
  }
  repeat(box.dim());
}

ThresholdMask ThresholdMask::whiteNoise(std::uint64_t seed) {
  ThresholdMask mask;
  mask.seed_ = seed;
  return mask;
}

Coord ThresholdMask::size() const {
  return values_.empty() ? Coord(0) : Coord(axes_[0].period, axes_[1].period, axes_[2].period);
}

float ThresholdMask::operator()(const Coord& ijk) const {
  if (values_.empty()) {
    std::uint64_t hash = splitMix(seed_);
    for (int axis = 0; axis < 3; ++axis)
      hash = splitMix(hash ^ static_cast<std::uint32_t>(ijk[axis]));
    // Odd multiples of 2⁻²⁴: each is exact as a float, and none is 0 or 1.
    return static_cast<float>(2 * (hash >> 41U) + 1) * 0x1p-24F;
  }
  return values_[axes_[0](ijk.x()) + axes_[1](ijk.y()) + axes_[2](ijk.z())];
}

void ThresholdMask::column(const Coord& ijk, std::span<float> thresholds) const {
  if (values_.empty()) {
    Coord at = ijk;
    for (float& threshold : thresholds) {
      threshold = (*this)(at);
      ++at.z();
    }
    return;
  }
  const float* values = values_.data() + axes_[0](ijk.x()) + axes_[1](ijk.y());
  const auto period = static_cast<std::size_t>(axes_[2].period);
  std::size_t z = axes_[2](ijk.z());
  for (float& threshold : thresholds) {
    threshold = values[z];
    if (++z == period) z = 0;
  }
}

}  // namespace vdbdither
