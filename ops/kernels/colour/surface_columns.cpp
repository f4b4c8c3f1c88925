#include "ops/kernels/colour/surface_columns.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <utility>
#include <vector>

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include "ops/kernels/distance/gradient.h"
#include "ops/kernels/leaf/true_bits.h"

namespace vdbdither {

using openvdb::Coord;
using openvdb::Vec3d;

namespace {

using MaskLeaf = openvdb::MaskTree::LeafNodeType;

/// What a code of Reader has room for.
constexpr int maximum_length = 42;

/// Returns how many leaves before its own hold the beginnings of a voxel's columns, at most.
constexpr int leavesBefore(int length) { return (length - 1 + leaf_layers - 1) / leaf_layers; }

int axisOf(unsigned direction) { return static_cast<int>(direction / 2); }
int outwardOf(unsigned direction) { return direction % 2 == 0 ? 1 : -1; }

int lengthOf(double depth_mm, double pitch_mm) {
  return static_cast<int>(std::clamp(std::ceil(depth_mm / pitch_mm), 1.0, double{maximum_length}));
}

/// Returns the bits of the voxels' neighbours in a direction. `beside` is the leaf there.
LeafBits neighbours(const LeafBits& bits, const LeafBits& beside, unsigned direction) {
  constexpr std::uint64_t lowest = everyRow(1);
  constexpr std::uint64_t highest = everyRow(0x80);
  LeafBits result;
  for (unsigned x = 0; x < 8; ++x) {
    switch (direction) {
      case 0:
        result[x] = x < 7 ? bits[x + 1] : beside[0];
        break;
      case 1:
        result[x] = x > 0 ? bits[x - 1] : beside[7];
        break;
      case 2:
        result[x] = bits[x] >> 8 | beside[x] << 56;
        break;
      case 3:
        result[x] = bits[x] << 8 | beside[x] >> 56;
        break;
      case 4:
        result[x] = (bits[x] >> 1 & ~highest) | (beside[x] & lowest) << 7;
        break;
      default:
        result[x] = (bits[x] << 1 & ~lowest) | (beside[x] & highest) >> 7;
    }
  }
  return result;
}

/// Returns the bits of the voxels with the index `at` along an axis. Their order is that of the two
/// other axes.
std::uint64_t planeOf(const LeafBits& bits, int axis, unsigned at) {
  if (axis == 0) return bits[at];
  std::uint64_t plane = 0;
  for (unsigned x = 0; x < 8; ++x) {
    // Of z, the product brings one bit of each row together.
    const std::uint64_t row = axis == 1
                                  ? bits[x] >> (8 * at) & 0xffU
                                  : ((bits[x] >> at & everyRow(1)) * 0x0102040810204080U) >> 56;
    plane |= row << (8 * x);
  }
  return plane;
}

/// Returns the offset in the leaf of a bit of such a plane.
unsigned offsetOf(unsigned bit, int axis, unsigned at) {
  switch (axis) {
    case 0:
      return 64 * at + bit;
    case 1:
      return 64 * (bit / 8) + 8 * at + bit % 8;
    default:
      return 8 * bit + at;
  }
}

/// Returns the direction of the axis that a normal is closest to, or none of the zero vector.
/// Between two axes, where the rounding of a normal would choose, it is the last one.
unsigned directionOf(const openvdb::Vec3s& normal, unsigned none) {
  constexpr float closer = 1.001F;
  int axis = 0;
  for (const int other : {1, 2})
    if (std::abs(normal[other]) * closer >= std::abs(normal[axis])) axis = other;
  if (normal[axis] == 0) return none;
  return static_cast<unsigned>(2 * axis) + (normal[axis] < 0 ? 1U : 0U);
}

Coord beside(const Coord& origin, unsigned direction, int leaves) {
  Coord result = origin;
  result[axisOf(direction)] += leaf_layers * leaves * outwardOf(direction);
  return result;
}

}  // namespace

int SurfaceColumns::reachLayers(const Vec3d& pitch_mm, double depth_mm) {
  return lengthOf(depth_mm, pitch_mm.z());
}

SurfaceColumns::SurfaceColumns(const openvdb::FloatTree& surface, const openvdb::BoolTree& solid,
                               const Vec3d& pitch_mm, double depth_mm, ZRange valid)
    : solid_(solid), pitch_mm_(pitch_mm), valid_(valid) {
  for (int axis = 0; axis < 3; ++axis)
    lengths_[static_cast<std::size_t>(axis)] = lengthOf(depth_mm, pitch_mm[axis]);

  const std::vector<const FloatLeaf*> leaves = leavesIn(surface, valid);
  std::vector<std::array<std::unique_ptr<MaskLeaf>, directions>> made(leaves.size());
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, leaves.size()), [&](const auto& range) {
    const openvdb::tree::ValueAccessor<const openvdb::BoolTree, false> printed(solid);
    LeafNormals normals(surface, pitch_mm, valid);
    for (std::size_t n = range.begin(); n != range.end(); ++n) {
      const FloatLeaf& leaf = *leaves[n];
      const LeafBits inside = trueBits(printed, leaf.origin(), valid);
      if (inside == no_bits) continue;
      const LeafBits known = activeBits(leaf, rowWithin(leaf.origin().z(), valid));
      std::array<LeafBits, directions> open;
      LeafBits wanted{};
      for (unsigned direction = 0; direction < directions; ++direction) {
        const LeafBits outer = neighbours(
            inside, trueBits(printed, beside(leaf.origin(), direction, 1), valid), direction);
        for (unsigned x = 0; x < 8; ++x) {
          open[direction][x] = inside[x] & ~outer[x] & known[x];
          wanted[x] |= open[direction][x];
        }
      }
      if (wanted == no_bits) continue;
      normals.visit(leaf, wanted);
      forEachBit(wanted, [&](unsigned offset) {
        const unsigned direction = directionOf(normals.normal(offset), directions);
        if (direction == directions) return;
        if ((open[direction][offset / 64] >> (offset % 64) & 1U) == 0) return;
        std::unique_ptr<MaskLeaf>& begin = made[n][direction];
        if (!begin) begin = std::make_unique<MaskLeaf>(leaf.origin());
        begin->setValueOn(offset);
      });
    }
  });
  for (auto& of_leaf : made)
    for (unsigned direction = 0; direction < directions; ++direction)
      if (of_leaf[direction]) beginnings_[direction].addLeaf(of_leaf[direction].release());
}

SurfaceColumns::Reader::Reader(const SurfaceColumns& columns)
    : columns_(columns), solid_(columns.solid_), beginnings_{Bits(columns.beginnings_[0]),
                                                             Bits(columns.beginnings_[1]),
                                                             Bits(columns.beginnings_[2]),
                                                             Bits(columns.beginnings_[3]),
                                                             Bits(columns.beginnings_[4]),
                                                             Bits(columns.beginnings_[5])} {}

LeafBits SurfaceColumns::Reader::beginnings(unsigned direction, const Coord& origin) const {
  LeafBits bits{};
  if (const MaskLeaf* leaf = beginnings_[direction].probeConstLeaf(origin))
    for (unsigned x = 0; x < 8; ++x) bits[x] = leaf->getValueMask().getWord<std::uint64_t>(x);
  return bits;
}

bool SurfaceColumns::Reader::visit(const Coord& origin) {
  origin_ = origin;
  codes_.fill(0);
  has_depths_ = false;
  for (unsigned direction = 0; direction < directions; ++direction) follow(direction);
  return has_depths_ &&
         std::any_of(codes_.begin(), codes_.end(), [](std::uint8_t code) { return code != 0; });
}

/// Follows the columns of one direction from their beginnings, in the leaf or in those before it,
/// through the leaf, plane by plane.
void SurfaceColumns::Reader::follow(unsigned direction) {
  const int axis = axisOf(direction);
  const int length = columns_.lengths_[static_cast<std::size_t>(axis)];
  const double pitch_mm = columns_.pitch_mm_[axis];
  std::array<LeafBits, leavesBefore(maximum_length) + 1> begin;
  int first = -1;  // the outermost leaf that holds beginnings
  for (int n = 0; n <= leavesBefore(length); ++n) {
    begin[static_cast<std::size_t>(n)] = beginnings(direction, beside(origin_, direction, n));
    if (begin[static_cast<std::size_t>(n)] != no_bits) first = n;
  }
  if (first < 0) return;
  if (!std::exchange(has_depths_, true)) depths_mm_.fill(std::numeric_limits<double>::infinity());

  // By place, the voxels of the plane that have it.
  std::array<std::uint64_t, maximum_length> places{};
  for (int n = first; n >= 0; --n) {
    const LeafBits& of_leaf = begin[static_cast<std::size_t>(n)];
    const LeafBits solid = trueBits(solid_, beside(origin_, direction, n), columns_.valid_);
    for (unsigned step = 0; step < leaf_layers; ++step) {
      const unsigned at = outwardOf(direction) > 0 ? leaf_layers - 1 - step : step;
      const std::uint64_t beginning = planeOf(of_leaf, axis, at);
      const std::uint64_t following = planeOf(solid, axis, at);
      for (int place = length - 1; place > 0; --place)
        places[static_cast<std::size_t>(place)] =
            places[static_cast<std::size_t>(place - 1)] & following;
      places[0] = beginning;
      if (n > 0) continue;
      for (int place = 0; place < length; ++place) {
        const double depth_mm = place * pitch_mm;
        const auto code =
            static_cast<std::uint8_t>(1 + direction + directions * static_cast<unsigned>(place));
        forEachBit(places[static_cast<std::size_t>(place)], [&](unsigned bit) {
          const unsigned offset = offsetOf(bit, axis, at);
          if (depth_mm >= depths_mm_[offset]) return;
          depths_mm_[offset] = depth_mm;
          codes_[offset] = code;
        });
      }
    }
  }
}

Coord SurfaceColumns::Reader::place(unsigned offset) const {
  const unsigned code = codes_[offset] - 1U;
  const unsigned direction = code % directions;
  Coord at = origin_ + openvdb::MaskTree::LeafNodeType::offsetToLocalCoord(offset);
  at[axisOf(direction)] = -outwardOf(direction) * static_cast<int>(code / directions);
  return at;
}

}  // namespace vdbdither
