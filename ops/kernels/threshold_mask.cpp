#include "ops/kernels/threshold_mask.h"

#include <bit>
#include <cassert>
#include <string>

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

ThresholdMask::ThresholdMask(const Coord& size, std::span<const float> values)
    : size_(size), blocks_(size.offsetBy(7) >> 3) {
  values_.resize(512 * openvdb::CoordBBox(Coord(1), blocks_).volume());
  const openvdb::CoordBBox tile(Coord(0), size.offsetBy(-1));
  assert(values.size() == tile.volume());
  auto value = values.begin();
  for (auto ijk = tile.begin(); ijk; ++ijk) values_[index(*ijk)] = *value++;
}

std::size_t ThresholdMask::index(const Coord& ijk) const {
  const Coord block = ijk >> 3;
  const int number = (block.x() * blocks_.y() + block.y()) * blocks_.z() + block.z();
  const int voxel = (ijk.x() & 7) << 6 | (ijk.y() & 7) << 3 | (ijk.z() & 7);
  return static_cast<std::size_t>(number) << 9 | static_cast<std::size_t>(voxel);
}

ThresholdMask ThresholdMask::fromGrid(const openvdb::FloatGrid& grid) {
  const openvdb::CoordBBox box = grid.evalActiveVoxelBoundingBox();
  if (box.empty()) throw DataError("a mask needs active voxels, and there are none");
  if (box.min() != Coord(0) || box.volume() != grid.activeVoxelCount()) {
    throw DataError("a mask is a box of active voxels from index 0,0,0 on; here " +
                    std::to_string(grid.activeVoxelCount()) + " are active from " +
                    text(box.min()) + " to " + text(box.max()));
  }
  std::vector<float> values(box.volume());
  openvdb::tools::Dense<float, openvdb::tools::LayoutZYX> dense(box, values.data());
  openvdb::tools::copyToDense(grid, dense);
  for (const float value : values) {
    if (!(value > 0.0F && value < 1.0F)) {
      throw DataError("a mask holds thresholds between 0 and 1, exclusive; here one is " +
                      std::to_string(value));
    }
  }
  return {box.dim(), values};
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
  return values_[index({positiveModulo(ijk.x(), size_.x()), positiveModulo(ijk.y(), size_.y()),
                        positiveModulo(ijk.z(), size_.z())})];
}

}  // namespace vdbdither
