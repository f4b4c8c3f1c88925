#include "ops/kernels/threshold_mask.h"

#include <bit>
#include <cassert>
#include <string>
#include <utility>

#include <openvdb/tools/Dense.h>

#include "vdbdither/errors.h"

namespace vdbdither {

using openvdb::Coord;

namespace {

/// The finalizer of SplitMix64 (Steele, Lea, Flood: Fast Splittable Pseudorandom Number Generators,
/// 2014).
std::uint64_t mixed(std::uint64_t bits) {
  bits += 0x9e3779b97f4a7c15U;
  bits = (bits ^ (bits >> 30U)) * 0xbf58476d1ce4e5b9U;
  bits = (bits ^ (bits >> 27U)) * 0x94d049bb133111ebU;
  return bits ^ (bits >> 31U);
}

std::string text(const Coord& ijk) {
  return std::to_string(ijk.x()) + "," + std::to_string(ijk.y()) + "," + std::to_string(ijk.z());
}

int positiveModulo(int value, int modulus) {
  if (std::has_single_bit(static_cast<unsigned>(modulus))) return value & (modulus - 1);
  const int rest = value % modulus;
  return rest < 0 ? rest + modulus : rest;
}

}  // namespace

ThresholdMask::ThresholdMask(const Coord& size, std::vector<float> values)
    : size_(size), values_(std::move(values)) {
  assert(values_.size() == static_cast<std::size_t>(size.x()) * static_cast<std::size_t>(size.y()) *
                               static_cast<std::size_t>(size.z()));
}

ThresholdMask::ThresholdMask(const openvdb::FloatGrid& grid) {
  const openvdb::CoordBBox box = grid.evalActiveVoxelBoundingBox();
  if (box.empty()) throw DataError("a mask needs active voxels, and there are none");
  if (box.min() != Coord(0) || box.volume() != grid.activeVoxelCount()) {
    throw DataError("a mask is a box of active voxels from index 0,0,0 on; here " +
                    std::to_string(grid.activeVoxelCount()) + " are active from " +
                    text(box.min()) + " to " + text(box.max()));
  }
  size_ = box.dim();
  values_.resize(box.volume());
  openvdb::tools::Dense<float, openvdb::tools::LayoutZYX> dense(box, values_.data());
  openvdb::tools::copyToDense(grid, dense);
  for (const float value : values_) {
    if (!(value > 0.0F && value < 1.0F)) {
      throw DataError("a mask holds thresholds between 0 and 1, exclusive; here one is " +
                      std::to_string(value));
    }
  }
}

ThresholdMask ThresholdMask::whiteNoise(std::uint64_t seed) {
  ThresholdMask mask;
  mask.seed_ = seed;
  return mask;
}

float ThresholdMask::operator()(const Coord& ijk) const {
  if (values_.empty()) {
    std::uint64_t hash = mixed(seed_);
    for (int axis = 0; axis < 3; ++axis) hash = mixed(hash ^ static_cast<std::uint32_t>(ijk[axis]));
    // The odd multiples of 2⁻²⁴: every one is a float, and none is 0 or 1.
    return static_cast<float>(2 * (hash >> 41U) + 1) * 0x1p-24F;
  }
  const int row =
      positiveModulo(ijk.x(), size_.x()) * size_.y() + positiveModulo(ijk.y(), size_.y());
  return values_[static_cast<std::size_t>(row) * static_cast<std::size_t>(size_.z()) +
                 static_cast<std::size_t>(positiveModulo(ijk.z(), size_.z()))];
}

}  // namespace vdbdither
