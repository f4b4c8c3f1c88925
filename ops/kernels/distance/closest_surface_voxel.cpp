// Eq. (4) of Morsy, Brunton, Urban: Shape Dithering for 3D Printing, ACM Transactions on Graphics
// 41(4), 2022.
//
// The surface voxels around a leaf are stored as bits, one word per column along z. A search visits
// the columns by rising lateral distance, finds the nearest bits above and below with two bit
// scans, and ends when the lateral distance alone exceeds the best: near the surface, after a few
// columns.

#include "ops/kernels/distance/closest_surface_voxel.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <tuple>
#include <utility>

namespace vdbdither {

using openvdb::Coord;

namespace {

/// The distances of a leaf that are all equal; they take the place of a tile.
constexpr std::array<float, 512> leafOf(float d) {
  std::array<float, 512> values{};
  values.fill(d);
  return values;
}
constexpr std::array<float, 512> tile_inside = leafOf(-1);
constexpr std::array<float, 512> tile_outside = leafOf(1);

/// The inside voxels of the lowest layer of a plane of equal x: bit 8·y.
std::uint64_t layerInside(const float* values) {
  std::uint64_t word = 0;
  for (unsigned y = 0; y < 8; ++y) word |= std::uint64_t{values[8 * y] < 0.0F} << (8 * y);
  return word;
}

constexpr int nowhere = std::numeric_limits<int>::max();

/// Returns how many bits below bit `z` of a column the nearest set bit is: 0 for the bit itself.
int stepsDown(const std::uint64_t* column, int z) {
  int word = z / 64;
  if (const std::uint64_t bits = column[word] << (63 - z % 64)) return std::countl_zero(bits);
  for (int steps = z % 64 + 1; --word >= 0; steps += 64) {
    if (column[word]) return steps + std::countl_zero(column[word]);
  }
  return nowhere;
}

/// The same upwards.
int stepsUp(const std::uint64_t* column, int words, int z) {
  int word = z / 64;
  if (const std::uint64_t bits = column[word] >> (z % 64)) return std::countr_zero(bits);
  for (int steps = 64 - z % 64; ++word < words; steps += 64) {
    if (column[word]) return steps + std::countr_zero(column[word]);
  }
  return nowhere;
}

}  // namespace

const float* SurfaceVoxels::valuesAt(const Coord& origin) {
  if (const FloatLeaf* leaf = surface_.probeConstLeaf(origin)) return leaf->buffer().data();
  return surface_.getValue(origin) < 0.0F ? tile_inside.data() : tile_outside.data();
}

LeafBits SurfaceVoxels::operator()(const FloatLeaf& leaf) {
  const Coord origin = leaf.origin();
  const LeafBits inside = insideBits(leaf, rowWithin(origin.z(), valid_));
  if (inside == no_bits) return no_bits;

  const float* below_x = valuesAt(origin.offsetBy(-8, 0, 0)) + 7 * 64;
  const float* above_x = valuesAt(origin.offsetBy(8, 0, 0));
  const float* below_y = valuesAt(origin.offsetBy(0, -8, 0)) + 7 * 8;
  const float* above_y = valuesAt(origin.offsetBy(0, 8, 0));
  const float* below_z = valid_.contains(origin.z() - 1) ? valuesAt(origin.offsetBy(0, 0, -8)) + 7
                                                         : tile_outside.data();
  const float* above_z =
      valid_.contains(origin.z() + 8) ? valuesAt(origin.offsetBy(0, 0, 8)) : tile_outside.data();
  LeafBits surface;
  for (unsigned x = 0; x < 8; ++x) {
    const std::uint64_t here = inside[x];
    surface[x] = 0;
    if (here == 0) continue;
    const std::uint64_t row_below_y = rowBelow(below_y + 64 * x, 0);
    const std::uint64_t row_above_y = rowBelow(above_y + 64 * x, 0);
    const std::uint64_t enclosed =
        (x > 0 ? inside[x - 1] : wordBelow(below_x, 0)) &
        (x < 7 ? inside[x + 1] : wordBelow(above_x, 0)) &  //
        (here << 8 | row_below_y) & (here >> 8 | row_above_y << 56) &
        ((here << 1 & everyRow(0xfe)) | layerInside(below_z + 64 * x)) &
        ((here >> 1 & everyRow(0x7f)) | layerInside(above_z + 64 * x) << 7);
    surface[x] = here & ~enclosed;
  }
  return surface;
}

SearchDisk::SearchDisk(const openvdb::Vec3d& pitch_mm, double radius_mm)
    : radius2_(radius_mm * radius_mm) {
  const auto square = [&](int steps, int axis) {
    const double distance = steps * pitch_mm[axis];
    return distance * distance;
  };
  for (int axis = 0; axis < 3; ++axis) {
    halo_[axis] = static_cast<int>(radius_mm / pitch_mm[axis]) + 1;
    while (halo_[axis] > 0 && square(halo_[axis], axis) > radius2_) --halo_[axis];
    leaves_[axis] = (halo_[axis] + 7) / 8;
  }
  words_ = (8 * (2 * leaves_.z() + 1) + 63) / 64;
  for (int k = 0; k <= halo_.z(); ++k) height2_.push_back(square(k, 2));

  for (int i = -halo_.x(); i <= halo_.x(); ++i) {
    for (int j = -halo_.y(); j <= halo_.y(); ++j) {
      const double lateral2 = square(i, 0) + square(j, 1);
      if (lateral2 > radius2_) continue;
      columns_.push_back({lateral2, i, j, (i * (8 + 2 * halo_.y()) + j) * words_});
    }
  }
  std::sort(columns_.begin(), columns_.end(), [](const Column& a, const Column& b) {
    return std::tie(a.lateral2, a.j, a.i) < std::tie(b.lateral2, b.j, b.i);
  });
}

ClosestSurfaceVoxel::ClosestSurfaceVoxel(const openvdb::FloatTree& surface_voxels,
                                         const SearchDisk& disk)
    : surface_voxels_(surface_voxels), disk_(disk) {
  const Coord& halo = disk.halo_;
  tile_.resize(static_cast<std::size_t>((8 + 2 * halo.x()) * (8 + 2 * halo.y()) * disk.words_));
}

bool ClosestSurfaceVoxel::visit(const Coord& origin) {
  const Coord& reach = disk_.leaves_;
  origin_ = origin;
  leaves_.clear();
  gathered_ = false;
  bool any = false;
  for (int x = -reach.x(); x <= reach.x(); ++x) {
    for (int y = -reach.y(); y <= reach.y(); ++y) {
      for (int z = -reach.z(); z <= reach.z(); ++z) {
        leaves_.push_back(surface_voxels_.probeConstLeaf(origin.offsetBy(8 * x, 8 * y, 8 * z)));
        any |= leaves_.back() != nullptr;
      }
    }
  }
  return any;
}

void ClosestSurfaceVoxel::gather() {
  const Coord& halo = disk_.halo_;
  const Coord& reach = disk_.leaves_;
  const int width_y = 8 + 2 * halo.y();
  std::fill(tile_.begin(), tile_.end(), 0);
  const FloatLeaf* const* leaf = leaves_.data();
  for (int x = -8 * reach.x(); x <= 8 * reach.x(); x += 8) {
    for (int y = -8 * reach.y(); y <= 8 * reach.y(); y += 8) {
      for (int bit = 0; bit <= 16 * reach.z(); bit += 8, ++leaf) {
        if (!*leaf) continue;
        for (int i = std::max(0, -halo.x() - x); i < std::min(8, 8 + halo.x() - x); ++i) {
          const auto word =
              (*leaf)->getValueMask().getWord<std::uint64_t>(static_cast<unsigned>(i));
          if (word == 0) continue;
          const int row = (x + i + halo.x()) * width_y + y + halo.y();
          for (int j = std::max(0, -halo.y() - y); j < std::min(8, 8 + halo.y() - y); ++j) {
            tile_[static_cast<std::size_t>((row + j) * disk_.words_ + bit / 64)] |=
                (word >> (8 * j) & 0xffU) << (bit % 64);
          }
        }
      }
    }
  }
  gathered_ = true;
}

std::optional<ClosestSurfaceVoxel::Found> ClosestSurfaceVoxel::operator()(unsigned offset) {
  if (!gathered_) gather();
  const Coord local = FloatLeaf::offsetToLocalCoord(offset);
  const Coord& halo = disk_.halo_;
  const int z = local.z() + 8 * disk_.leaves_.z();
  const std::uint64_t* centre =
      tile_.data() +
      ((local.x() + halo.x()) * (8 + 2 * halo.y()) + local.y() + halo.y()) * disk_.words_;

  double best2 = disk_.radius2_;
  const SearchDisk::Column* best_column = nullptr;
  int best_k = 0;
  for (const SearchDisk::Column& column : disk_.columns_) {
    if (column.lateral2 > best2) break;
    const std::uint64_t* words = centre + column.offset;
    if (disk_.words_ == 1 && *words == 0) continue;
    const int below = stepsDown(words, z);
    const int above = stepsUp(words, disk_.words_, z);
    const int steps = std::min(below, above);
    if (steps > halo.z()) continue;
    const double distance2 = column.lateral2 + disk_.height2_[static_cast<std::size_t>(steps)];
    const int k = below <= above ? -below : above;
    const bool better = distance2 < best2 ||
                        (distance2 == best2 &&
                         (!best_column || std::tie(k, column.j, column.i) <
                                              std::tie(best_k, best_column->j, best_column->i)));
    if (!better) continue;
    best2 = distance2;
    best_column = &column;
    best_k = k;
  }
  if (!best_column) return std::nullopt;

  const Coord found = local + Coord(best_column->i, best_column->j, best_k);
  const Coord& reach = disk_.leaves_;
  const int leaf =
      (((found.x() >> 3) + reach.x()) * (2 * reach.y() + 1) + (found.y() >> 3) + reach.y()) *
          (2 * reach.z() + 1) +
      (found.z() >> 3) + reach.z();
  return Found{origin_ + found,
               leaves_[static_cast<std::size_t>(leaf)]->getValue(FloatLeaf::coordToOffset(found))};
}

}  // namespace vdbdither
