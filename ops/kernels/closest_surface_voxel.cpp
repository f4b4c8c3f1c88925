// Eq. (4) of Morsy, Brunton, Urban: Shape Dithering for 3D Printing, ACM Transactions on Graphics
// 41(4), 2022.
//
// The surface voxels around a leaf are kept as bits, one word per column along z. A search walks
// the columns by rising lateral distance, finds the nearest bits above and below with two bit
// scans, and ends as soon as the lateral distance alone exceeds the best: near the surface that is
// after a handful of columns.

#include "ops/kernels/closest_surface_voxel.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <tuple>
#include <utility>

namespace vdbdither {

using openvdb::Coord;

namespace {

/// The other side of one of a leaf's faces.
class Neighbour {
 public:
  Neighbour(openvdb::tree::ValueAccessor<const openvdb::FloatTree, false>& surface,
            const Coord& origin, ZRange valid)
      : leaf_(surface.probeConstLeaf(origin)),
        row_(rowWithin(origin.z(), valid)),
        tile_inside_(!leaf_ && surface.getValue(origin) < 0.0F) {}

  /// 64 voxels of V as bits, the n-th at `offset_of(n)`.
  template <typename OffsetOf>
  [[nodiscard]] std::uint64_t inside(OffsetOf offset_of) const {
    std::uint64_t word = 0;
    for (unsigned n = 0; n < 64; ++n) {
      const unsigned offset = offset_of(n);
      const bool inside = leaf_ ? leaf_->buffer().data()[offset] < 0.0F : tile_inside_;
      word |= std::uint64_t{inside && ((row_ >> (offset % 8)) & 1U)} << n;
    }
    return word;
  }

 private:
  const FloatLeaf* leaf_;
  std::uint8_t row_;
  bool tile_inside_;
};

/// Bit y of `column` moved to bit 8·y.
std::uint64_t spread(std::uint64_t column) {
  std::uint64_t word = 0;
  for (unsigned y = 0; y < 8; ++y) word |= ((column >> y) & 1U) << (8 * y);
  return word;
}

constexpr int nowhere = std::numeric_limits<int>::max();

/// How far below bit `z` of a column the nearest set bit is: 0 for the bit itself.
int stepsDown(const std::uint64_t* column, int z) {
  int word = z / 64;
  if (const std::uint64_t bits = column[word] << (63 - z % 64)) return std::countl_zero(bits);
  for (int steps = z % 64 + 1; --word >= 0; steps += 64) {
    if (column[word]) return steps + std::countl_zero(column[word]);
  }
  return nowhere;
}

/// The same above.
int stepsUp(const std::uint64_t* column, int words, int z) {
  int word = z / 64;
  if (const std::uint64_t bits = column[word] >> (z % 64)) return std::countr_zero(bits);
  for (int steps = 64 - z % 64; ++word < words; steps += 64) {
    if (column[word]) return steps + std::countr_zero(column[word]);
  }
  return nowhere;
}

}  // namespace

LeafBits SurfaceVoxels::operator()(const FloatLeaf& leaf) {
  const Coord origin = leaf.origin();
  const LeafBits inside = insideBits(leaf, rowWithin(origin.z(), valid_));
  if (inside == no_bits) return no_bits;

  const auto across = [&](int x, int y, int z) {
    return Neighbour(surface_, origin.offsetBy(x, y, z), valid_);
  };
  const std::uint64_t below_x = across(-8, 0, 0).inside([](unsigned n) { return 7 * 64 + n; });
  const std::uint64_t above_x = across(8, 0, 0).inside([](unsigned n) { return n; });
  const std::uint64_t below_y =
      across(0, -8, 0).inside([](unsigned n) { return n / 8 * 64 + 7 * 8 + n % 8; });
  const std::uint64_t above_y =
      across(0, 8, 0).inside([](unsigned n) { return n / 8 * 64 + n % 8; });
  const std::uint64_t below_z = across(0, 0, -8).inside([](unsigned n) { return n * 8 + 7; });
  const std::uint64_t above_z = across(0, 0, 8).inside([](unsigned n) { return n * 8; });

  LeafBits surface;
  for (unsigned x = 0; x < 8; ++x) {
    const std::uint64_t here = inside[x];
    const std::uint64_t enclosed =
        (x > 0 ? inside[x - 1] : below_x) & (x < 7 ? inside[x + 1] : above_x) &
        ((here << 8) | ((below_y >> (8 * x)) & 0xffU)) &
        ((here >> 8) | (((above_y >> (8 * x)) & 0xffU) << 56)) &
        (((here << 1) & everyRow(0xfe)) | spread(below_z >> (8 * x))) &
        (((here >> 1) & everyRow(0x7f)) | (spread(above_z >> (8 * x)) << 7));
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
  const Coord& halo = disk_.halo_;
  const Coord& reach = disk_.leaves_;
  const int width_y = 8 + 2 * halo.y();
  origin_ = origin;
  leaves_.clear();
  bool any = false;
  for (int x = -reach.x(); x <= reach.x(); ++x) {
    for (int y = -reach.y(); y <= reach.y(); ++y) {
      for (int z = -reach.z(); z <= reach.z(); ++z) {
        const FloatLeaf* leaf =
            surface_voxels_.probeConstLeaf(origin.offsetBy(8 * x, 8 * y, 8 * z));
        leaves_.push_back(leaf);
        if (!leaf) continue;
        if (!std::exchange(any, true)) std::fill(tile_.begin(), tile_.end(), 0);
        const int bit = 8 * (z + reach.z());
        for (int i = std::max(0, -halo.x() - 8 * x); i < std::min(8, 8 + halo.x() - 8 * x); ++i) {
          const auto word = leaf->getValueMask().getWord<std::uint64_t>(static_cast<unsigned>(i));
          for (int j = std::max(0, -halo.y() - 8 * y); j < std::min(8, 8 + halo.y() - 8 * y); ++j) {
            const int column = (8 * x + i + halo.x()) * width_y + 8 * y + j + halo.y();
            tile_[static_cast<std::size_t>(column * disk_.words_ + bit / 64)] |=
                ((word >> (8 * j)) & 0xffU) << (bit % 64);
          }
        }
      }
    }
  }
  return any;
}

std::optional<ClosestSurfaceVoxel::Found> ClosestSurfaceVoxel::operator()(unsigned offset) const {
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
    const int below = stepsDown(centre + column.offset, z);
    const int above = stepsUp(centre + column.offset, disk_.words_, z);
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
