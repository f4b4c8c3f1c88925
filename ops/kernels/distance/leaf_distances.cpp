// One source is compiled for the baseline and for AVX2. Without contraction both round every
// operation in the same way.
//
// A region is convex, so that along z it is one interval. The intervals of four columns are found
// at once; within them distances need no further test, except for the few voxels beside a triangle.

#include "ops/kernels/distance/leaf_distances.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <iterator>
#include <limits>

#include "ops/kernels/distance/row_crossings.h"
#include "ops/kernels/leaf/tie.h"
#include "vdbdither/model/instruction_set.h"

namespace vdbdither {

namespace {

constexpr int edge = leaf_layers;
constexpr std::size_t leaves_per_page = 32;

// The baseline uses two registers for one of these. They may alias the arrays that they are read
// from.
using Doubles = double __attribute__((vector_size(32), may_alias));
using Floats = float __attribute__((vector_size(16), may_alias));
using Integers = std::int32_t __attribute__((vector_size(16), may_alias));
// Copied from and to the arrays of leaves, which are aligned to 16 bytes only.
using Row = float __attribute__((vector_size(32), may_alias));
using RowBits = std::int32_t __attribute__((vector_size(32), may_alias));

constexpr int lanes = 4;
constexpr Doubles ramp{0, 1, 2, 3};
constexpr Integers integer_ramp{0, 1, 2, 3};

/// A bound solved for one axis: the offset along the axis is at least or at most that of the plane.
/// If the bound is a side of a triangle, the triangle begins `inwards` from the plane.
struct Limit {
  double x, y, constant, inwards;
};

/// The end of an empty interval.
constexpr double nowhere = -1e9;

/// Narrows [low, high], offsets along one axis, to where `best + slope · offset` can reach zero,
/// with a margin for rounding.
[[gnu::always_inline]] inline void narrow(const LatticeForm& form, double best, double slope,
                                          double& low, double& high) {
  best += 1e-9 * (std::abs(form.x) + std::abs(form.y) + std::abs(form.z));
  if (slope > 0) {
    low = std::max(low, -best / slope);
  } else if (slope < 0) {
    high = std::min(high, -best / slope);
  } else if (best < 0) {
    high = nowhere;
  }
}

/// More than the rounding error of a form in mm.
constexpr double rounding_mm = 1e-9;

/// Replaces the distances, mm, of the voxels of a column at k, k + 1, k + 2, k + 3 from a
/// triangle's plane by those from the triangle, infinite for voxels that are left out. Over the
/// triangle they are the same.
[[gnu::always_inline]] inline void measureToTriangle(const LatticeRegion& region, int i, int j,
                                                     int k, Doubles& distance) {
  const Doubles infinite = Doubles{} + std::numeric_limits<double>::infinity();
  Doubles beside = infinite;
  Doubles outermost = -infinite;
  for (const LatticeSide& side : region.side) {
    const LatticeForm& outward = side.outward;
    const LatticeForm& along = side.along;
    const Doubles out =
        ramp * outward.z + (outward.constant + outward.x * i + outward.y * j + outward.z * k);
    const Doubles at = ramp * along.z + (along.constant + along.x * i + along.y * j + along.z * k);
    const Doubles over = at - side.length_mm;
    Doubles past = over > 0 ? over : Doubles{};
    past = at < 0 ? at : past;
    const Doubles squared = out * out + past * past;
    beside = squared < beside ? squared : beside;
    outermost = out > outermost ? out : outermost;
  }
  Doubles far = distance * distance + beside;
  for (int l = 0; l < lanes; ++l) far[l] = std::sqrt(far[l]);
  far = beside > region.spread_mm * region.spread_mm ? infinite : far;
  distance = outermost > 0 ? far : distance;
}

/// The bounds of a region solved for z: it lies above the floors, below the ceilings, and behind
/// the walls, which are parallel to z.
struct BoundsAlongZ {
  std::array<Limit, LatticeRegion::max_bounds> floors, ceilings, walls;
  std::size_t floor_count = 0;
  std::size_t ceiling_count = 0;
  std::size_t wall_count = 0;
};

template <int rank>
[[gnu::always_inline]] inline BoundsAlongZ boundsAlongZ(const LatticeRegion& region) {
  BoundsAlongZ bounds;
  for (int b = 0; b < region.bounds; ++b) {
    const LatticeForm& form = region.bound[static_cast<std::size_t>(b)];
    constexpr double level = 1e-100;
    const bool side = rank == 1 && b < std::ssize(region.side);
    const double inwards_mm = side ? region.spread_mm + rounding_mm : 0;
    if (std::abs(form.z) < level) {
      bounds.walls[bounds.wall_count++] = {form.x, form.y, form.constant, inwards_mm};
      continue;
    }
    const double inverse = -1 / form.z;
    const Limit limit{form.x * inverse, form.y * inverse, form.constant * inverse,
                      inwards_mm * std::abs(inverse)};
    if (form.z > 0) {
      bounds.floors[bounds.floor_count++] = limit;
    } else {
      bounds.ceilings[bounds.ceiling_count++] = limit;
    }
  }
  return bounds;
}

/// The voxels [begin, end] of four columns along x that lie in a region. For rank 1 those in
/// [inner_low, inner_high] lie over the triangle.
struct FourColumns {
  Integers begin, end;
  Doubles inner_low, inner_high;

  [[gnu::always_inline]] bool empty() const {
    const auto some = std::bit_cast<std::array<std::int64_t, 2>>(begin <= end);
    return (some[0] | some[1]) == 0;
  }
};

/// The bounds in one row of columns along x: what they have in common at one j.
class RowBounds {
 public:
  [[gnu::always_inline]] RowBounds(const BoundsAlongZ& bounds, int j, double k_first, double k_last)
      : bounds_(bounds), j_(j), k_first_(k_first), k_last_(k_last) {
    for (std::size_t f = 0; f < bounds.floor_count; ++f)
      floors_[f] = bounds.floors[f].constant + bounds.floors[f].y * j;
    for (std::size_t c = 0; c < bounds.ceiling_count; ++c)
      ceilings_[c] = bounds.ceilings[c].constant + bounds.ceilings[c].y * j;
  }

  /// Those of the columns i, i + 1, i + 2, i + 3 that lie before i_end.
  [[gnu::always_inline]] FourColumns columns(int i, int i_end) const {
    const Doubles columns = ramp + static_cast<double>(i);
    Doubles low = Doubles{} + k_first_;
    Doubles high = Doubles{} + k_last_;
    Doubles inner_low = low;
    Doubles inner_high = high;
    for (std::size_t f = 0; f < bounds_.floor_count; ++f) {
      const Doubles at = columns * bounds_.floors[f].x + floors_[f];
      low = at > low ? at : low;
      const Doubles inner = at + bounds_.floors[f].inwards;
      inner_low = inner > inner_low ? inner : inner_low;
    }
    for (std::size_t c = 0; c < bounds_.ceiling_count; ++c) {
      const Doubles at = columns * bounds_.ceilings[c].x + ceilings_[c];
      high = at < high ? at : high;
      const Doubles inner = at - bounds_.ceilings[c].inwards;
      inner_high = inner < inner_high ? inner : inner_high;
    }
    for (std::size_t w = 0; w < bounds_.wall_count; ++w) {
      const Limit& wall = bounds_.walls[w];
      const Doubles at = columns * wall.x + (wall.constant + wall.y * j_);
      high = at < 0 ? Doubles{} + nowhere : high;
      inner_high = at < wall.inwards ? Doubles{} + nowhere : inner_high;
    }
    high = columns < static_cast<double>(i_end) ? high : Doubles{} + nowhere;
    low = low < k_last_ + 1 ? low : Doubles{} + (k_last_ + 1);
    high = high > nowhere ? high : Doubles{} + nowhere;
    // Conversion truncates positive and negative numbers.
    Doubles begin = __builtin_convertvector(__builtin_convertvector(low, Integers), Doubles);
    begin = begin < low ? begin + 1 : begin;
    Doubles end = __builtin_convertvector(__builtin_convertvector(high, Integers), Doubles);
    end = end > high ? end - 1 : end;
    return {__builtin_convertvector(begin, Integers), __builtin_convertvector(end, Integers),
            inner_low, inner_high};
  }

 private:
  const BoundsAlongZ& bounds_;
  int j_;
  double k_first_, k_last_;
  std::array<double, LatticeRegion::max_bounds> floors_, ceilings_;
};

/// Lowers the distances of the voxels of column (i, j) from k_begin to k_end. Those below over_low
/// and above over_high lie beside the triangle of a region of rank 1.
template <int rank, bool track>
[[gnu::always_inline]] inline void lowerColumn(const LatticeRegion& region, std::uint32_t name,
                                               LeafDistances& leaves, int i, int j, int k_begin,
                                               int k_end, double over_low, double over_high) {
  const openvdb::Coord leaf_base = (region.base >> 3) - leaves.leaves().min();
  std::array<double, rank> column;
  for (std::size_t f = 0; f < rank; ++f) {
    const LatticeForm& form = region.distance[f];
    column[f] = form.constant + form.x * i + form.y * j;
  }
  const std::size_t slot =
      static_cast<std::size_t>(leaf_base.x() + (i >> 3)) * leaves.stride() +
      static_cast<std::size_t>(leaf_base.y() + (j >> 3)) * LeafDistances::depth;
  const int row = (i & 7) * edge * edge + (j & 7) * edge;
  for (int k = k_begin & ~(lanes - 1); k <= k_end; k += lanes) {
    Floats distance;
    if constexpr (rank == 1) {
      Doubles form = ramp * region.distance[0].z + (column[0] + region.distance[0].z * k);
      if (std::max(k, k_begin) < over_low || std::min(k + (lanes - 1), k_end) > over_high)
        measureToTriangle(region, i, j, k, form);
      distance = __builtin_convertvector(form, Floats);
      reinterpret_cast<Integers&>(distance) &= 0x7fffffff;
    } else {
      Doubles squared{};
      for (std::size_t f = 0; f < rank; ++f) {
        const Doubles form = ramp * region.distance[f].z + (column[f] + region.distance[f].z * k);
        squared += form * form;
      }
      for (int l = 0; l < lanes; ++l) squared[l] = std::sqrt(squared[l]);
      distance = __builtin_convertvector(squared, Floats);
    }
    const std::size_t at = slot + static_cast<std::size_t>(leaf_base.z() + (k >> 3));
    float* leaf = leaves.distances(at);
    if (leaf == nullptr) leaf = leaves.make(at);
    const int offset = row + (k & 7);
    auto& nearest = *reinterpret_cast<Floats*>(leaf + offset);
    const Integers ks = integer_ramp + k;
    const Integers take = (ks >= k_begin) & (ks <= k_end) & (distance < nearest);
    nearest = take ? distance : nearest;
    if constexpr (track) {
      auto& names = *reinterpret_cast<Integers*>(leaves.names(at) + offset);
      names = take ? Integers{} + static_cast<std::int32_t>(name) : names;
    }
  }
}

template <int rank, bool track>
[[gnu::always_inline]] inline void lowerBy(const LatticeRegion& region, std::uint32_t name,
                                           LeafDistances& leaves) {
  const openvdb::Coord first = region.reach.min() - region.base;
  const openvdb::Coord last = region.reach.max() - region.base;
  // Regions of a few planes are not narrowed further.
  constexpr int few = 8;

  const double k_first = first.z();
  const double k_last = last.z();
  const BoundsAlongZ bounds = boundsAlongZ<rank>(region);
  double j_low = first.y();
  double j_high = last.y();
  if (last.y() - first.y() >= few) {
    for (int b = 0; b < region.bounds; ++b) {
      const LatticeForm& form = region.bound[static_cast<std::size_t>(b)];
      narrow(form,
             form.constant + std::max(form.x * first.x(), form.x * last.x()) +
                 std::max(form.z * k_first, form.z * k_last),
             form.y, j_low, j_high);
    }
    if (!(j_low <= j_high)) return;
  }

  for (int j = roundedUp(j_low); j <= roundedDown(j_high); ++j) {
    double i_low = first.x();
    double i_high = last.x();
    if (last.x() - first.x() >= few) {
      for (int b = 0; b < region.bounds; ++b) {
        const LatticeForm& form = region.bound[static_cast<std::size_t>(b)];
        narrow(form, form.constant + form.y * j + std::max(form.z * k_first, form.z * k_last),
               form.x, i_low, i_high);
      }
      if (!(i_low <= i_high)) continue;
    }
    const int i_end = roundedDown(i_high) + 1;
    const RowBounds row(bounds, j, k_first, k_last);
    for (int i = roundedUp(i_low); i < i_end; i += lanes) {
      const FourColumns columns = row.columns(i, i_end);
      if (columns.empty()) continue;
      for (int lane = 0; lane < lanes; ++lane)
        if (columns.begin[lane] <= columns.end[lane])
          lowerColumn<rank, track>(region, name, leaves, i + lane, j, columns.begin[lane],
                                   columns.end[lane], columns.inner_low[lane],
                                   columns.inner_high[lane]);
    }
  }
}

[[gnu::always_inline]] inline void lowerAny(const LatticeRegion& region, std::uint32_t name,
                                            bool track, LeafDistances& leaves) {
  switch (region.rank) {
    case 1:
      return track ? lowerBy<1, true>(region, name, leaves)
                   : lowerBy<1, false>(region, name, leaves);
    case 2:
      return track ? lowerBy<2, true>(region, name, leaves)
                   : lowerBy<2, false>(region, name, leaves);
    default:
      return track ? lowerBy<3, true>(region, name, leaves)
                   : lowerBy<3, false>(region, name, leaves);
  }
}

[[gnu::always_inline]] inline void raiseAll(const LatticeSheet& sheet, float value,
                                            const LeafDistances& at, float* values) {
  const openvdb::Coord first = sheet.leaves.min() - sheet.base;
  const openvdb::Coord last = sheet.leaves.max() - sheet.base;
  const int low = sheet.leaves.min().z() - at.leaves().min().z();
  const int high = sheet.leaves.max().z() - at.leaves().min().z();
  const int above = at.leaves().min().z() - sheet.base.z();  // of the lowest leaf of the box
  const Floats raised = Floats{} + value;
  for (int x = first.x(); x <= last.x(); ++x) {
    for (int y = first.y(); y <= last.y(); ++y) {
      const double row = sheet.form.constant + sheet.form.x * x + sheet.form.y * y;
      float* column =
          values + at.slot({sheet.base.x() + x, sheet.base.y() + y, at.leaves().min().z()});
      for (int z = low & ~(lanes - 1); z <= high; z += lanes) {
        const Doubles form = (ramp + static_cast<double>(z + above)) * sheet.form.z + row;
        const Floats off = __builtin_convertvector(form, Floats);
        const auto limit = static_cast<float>(sheet.limit);
        const Integers zs = integer_ramp + z;
        auto& present = *reinterpret_cast<Floats*>(column + z);
        const Integers take =
            (zs >= low) & (zs <= high) & (off <= limit) & (off >= -limit) & (present < raised);
        present = take ? raised : present;
      }
    }
  }
}

[[gnu::always_inline]] inline LeafBits finishAll(const float* distances, const LeafBits& inside,
                                                 const LeafBits& exists, float tie_mm,
                                                 float limit_mm, float background_mm,
                                                 float* values) {
  constexpr RowBits bit{1, 2, 4, 8, 16, 32, 64, 128};
  const Row background = Row{} + background_mm;
  const Row tied = Row{} + tied_mm;
  LeafBits active;
  for (std::size_t plane = 0; plane < edge; ++plane) {
    std::uint64_t found = 0;
    for (int row = 0; row < edge * edge; row += edge) {
      const std::size_t offset = plane * edge * edge + static_cast<std::size_t>(row);
      Row distance;
      std::memcpy(&distance, distances + offset, sizeof distance);
      const RowBits on =
          (distance < limit_mm) & ((static_cast<std::int32_t>(exists[plane] >> row) & bit) == bit);
      Row value = distance < tie_mm ? tied : distance;
      value = on ? value : background;
      reinterpret_cast<RowBits&>(value) |=
          ((static_cast<std::int32_t>(inside[plane] >> row) & bit) == bit) &
          std::numeric_limits<std::int32_t>::min();
      value += 0.0F;  // no negative zero
      std::memcpy(values + offset, &value, sizeof value);
#ifdef __SSE2__
      const auto* halves = reinterpret_cast<const __m128*>(&on);
      const auto marks =
          static_cast<unsigned>(_mm_movemask_ps(halves[0]) | _mm_movemask_ps(halves[1]) << 4);
#else
      unsigned marks = 0;
      for (int z = 0; z < edge; ++z) marks |= static_cast<unsigned>(on[z] & bit[z]);
#endif
      found |= std::uint64_t{marks} << row;
    }
    active[plane] = found;
  }
  return active;
}

void lowerPortable(const LatticeRegion& region, std::uint32_t name, bool track,
                   LeafDistances& leaves) {
  lowerAny(region, name, track, leaves);
}
void raisePortable(const LatticeSheet& sheet, float value, const LeafDistances& at, float* values) {
  raiseAll(sheet, value, at, values);
}
LeafBits finishPortable(const float* distances, const LeafBits& inside, const LeafBits& exists,
                        float tie_mm, float limit_mm, float background_mm, float* values) {
  return finishAll(distances, inside, exists, tie_mm, limit_mm, background_mm, values);
}

#if defined(__x86_64__)
__attribute__((target("avx2"))) void lowerAvx2(const LatticeRegion& region, std::uint32_t name,
                                               bool track, LeafDistances& leaves) {
  lowerAny(region, name, track, leaves);
}
__attribute__((target("avx2"))) void raiseAvx2(const LatticeSheet& sheet, float value,
                                               const LeafDistances& at, float* values) {
  raiseAll(sheet, value, at, values);
}
__attribute__((target("avx2"))) LeafBits finishAvx2(const float* distances, const LeafBits& inside,
                                                    const LeafBits& exists, float tie_mm,
                                                    float limit_mm, float background_mm,
                                                    float* values) {
  return finishAll(distances, inside, exists, tie_mm, limit_mm, background_mm, values);
}
#endif

}  // namespace

template <class Value>
Value* LeafDistances::Pool<Value>::take() {
  const std::size_t page = used / leaves_per_page;
  if (page == pages.size()) pages.emplace_back(new Value[leaves_per_page * voxels]);
  return pages[page].get() + used++ % leaves_per_page * voxels;
}

void LeafDistances::begin(const openvdb::CoordBBox& leaves, bool track) {
  leaves_ = leaves;
  rows_ = static_cast<std::size_t>(leaves.dim().y());
  track_ = track;
  const std::size_t count = static_cast<std::size_t>(leaves.dim().x()) * rows_ * depth;
  occupied_.assign(static_cast<std::size_t>(leaves.dim().x()), 0);
  distances_.assign(count, nullptr);
  names_.assign(track ? count : 0, nullptr);
  last_note_.assign(count, none);
  notes_.clear();
  distance_pool_.used = 0;
  name_pool_.used = 0;
}

float* LeafDistances::make(std::size_t slot) {
  occupy(slot);
  distances_[slot] = distance_pool_.take();
  std::fill_n(distances_[slot], voxels, std::numeric_limits<float>::infinity());
  if (track_) {
    names_[slot] = name_pool_.take();
    std::fill_n(names_[slot], voxels, 0U);
  }
  return distances_[slot];
}

const LeafKernels& portableLeafKernels() {
  static const LeafKernels kernels{&lowerPortable, &raisePortable, &finishPortable};
  return kernels;
}

const LeafKernels& leafKernels() {
#if defined(__x86_64__)
  static const LeafKernels avx2{&lowerAvx2, &raiseAvx2, &finishAvx2};
  if (bestInstructionSet() == InstructionSet::avx2) return avx2;
#endif
  return portableLeafKernels();
}

}  // namespace vdbdither
