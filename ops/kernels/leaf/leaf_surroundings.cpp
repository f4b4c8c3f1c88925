#include "ops/kernels/leaf/leaf_surroundings.h"

#ifdef __SSE2__
#include <emmintrin.h>
#endif

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

namespace vdbdither {

using openvdb::Coord;

namespace {

using Lanes = std::array<std::uint32_t, 4>;

/// By four bits: lanes of all ones where the bit is set.
constexpr std::array<Lanes, 16> lanes_by_bits = [] {
  std::array<Lanes, 16> lanes{};
  for (unsigned bits = 0; bits < lanes.size(); ++bits) {
    for (unsigned lane = 0; lane < 4; ++lane) lanes[bits][lane] = (bits >> lane & 1U) ? ~0U : 0U;
  }
  return lanes;
}();

/// Copies four values; those whose bit is not set become the infinity of their sign.
inline void copyFour(float* out, const float* in, unsigned bits) {
#ifdef __SSE2__
  const __m128 held = _mm_loadu_ps(reinterpret_cast<const float*>(lanes_by_bits[bits].data()));
  const __m128 kept = _mm_and_ps(_mm_loadu_ps(in), _mm_or_ps(held, _mm_set1_ps(-0.0F)));
  const __m128 none = _mm_set1_ps(std::numeric_limits<float>::infinity());
  _mm_storeu_ps(out, _mm_or_ps(kept, _mm_andnot_ps(held, none)));
#else
  for (unsigned lane = 0; lane < 4; ++lane) {
    const bool held = (bits >> lane & 1U) != 0;
    out[lane] = held ? in[lane] : std::copysign(std::numeric_limits<float>::infinity(), in[lane]);
  }
#endif
}

}  // namespace

/// The values and states of the voxels of a leaf, or of a tile in its place, in the leaf's order.
struct LeafSurroundings::Block {
  const float* values;
  const openvdb::util::NodeMask<3>* active;

  /// Copies half a row: `z` is 0 or 4.
  void copyHalf(float* out, int x, int y, int z) const {
    const std::uint64_t word = active->getWord<std::uint64_t>(static_cast<openvdb::Index>(x));
    copyFour(out, values + 64 * x + 8 * y + z, static_cast<unsigned>(word >> (8 * y + z)) & 0xfU);
  }
};

LeafSurroundings::Block LeafSurroundings::blockAt(const Coord& origin) {
  static const openvdb::util::NodeMask<3> all(true);
  static const openvdb::util::NodeMask<3> none(false);
  static constexpr auto filled = [](float value) {
    std::array<float, 512> values{};
    values.fill(value);
    return values;
  };
  static constexpr std::array<float, 512> outside = filled(1);
  static constexpr std::array<float, 512> inside = filled(-1);
  if (rowWithin(origin.z(), valid_) == 0) return {outside.data(), &none};
  if (const FloatLeaf* leaf = surface_.probeConstLeaf(origin))
    return {leaf->buffer().data(), &leaf->getValueMask()};
  float value = 0;
  if (!surface_.probeValue(origin, value)) return {(value < 0 ? inside : outside).data(), &none};
  std::array<float, 512>& tile = tiles_.emplace_back();
  tile.fill(value);
  return {tile.data(), &all};
}

void LeafSurroundings::visit(const FloatLeaf& leaf, const LeafBits& wanted) {
  const Coord origin = leaf.origin();
  tiles_.clear();

  // The planes of equal x and of equal y that hold a wanted voxel, as bits.
  unsigned planes_x = 0;
  std::uint64_t rows = 0;
  for (unsigned x = 0; x < 8; ++x) {
    planes_x |= unsigned{wanted[x] != 0} << x;
    rows |= wanted[x];
  }
  if (rows == 0) return;
  struct Span {
    int begin, end;  ///< halos included
    [[nodiscard]] Span within(int step) const {
      return {std::max(begin - 8 * step, 0), std::min(end - 8 * step, 8)};
    }
  };
  const Span span_x{std::countr_zero(planes_x) - halo,
                    static_cast<int>(std::bit_width(planes_x)) + halo};
  // The layers, as bits: the leaves below and above matter only close to them.
  std::uint64_t layers = rows | rows >> 32;
  layers |= layers >> 16;
  layers |= layers >> 8;
  constexpr unsigned lowest = (1U << halo) - 1;
  const bool has_below = (layers & lowest) != 0;
  const bool has_above = (layers & lowest << (8 - halo)) != 0;
  const Span span_y{std::countr_zero(rows) / 8 - halo,
                    (static_cast<int>(std::bit_width(rows)) + 7) / 8 + halo};

  for (const int step_x : {-1, 0, 1}) {
    const Span of_x = span_x.within(step_x);
    for (const int step_y : {-1, 0, 1}) {
      const Span of_y = span_y.within(step_y);
      if (of_x.begin >= of_x.end || of_y.begin >= of_y.end) continue;
      const Coord beside = origin.offsetBy(8 * step_x, 8 * step_y, 0);
      const Block middle = blockAt(beside);
      const Block below = has_below ? blockAt(beside.offsetBy(0, 0, -8)) : middle;
      const Block above = has_above ? blockAt(beside.offsetBy(0, 0, 8)) : middle;
      for (int x = of_x.begin; x < of_x.end; ++x) {
        for (int y = of_y.begin; y < of_y.end; ++y) {
          float* row =
              &values_[static_cast<std::size_t>(indexOf(8 * step_x + x, 8 * step_y + y, 0))];
          if (has_below) below.copyHalf(row - 4, x, y, 4);
          middle.copyHalf(row, x, y, 0);
          middle.copyHalf(row + 4, x, y, 4);
          if (has_above) above.copyHalf(row + 8, x, y, 0);
        }
      }
    }
  }
  // The layers of these leaves that are not valid.
  for (int z = -halo; z < 8 + halo; ++z) {
    if (valid_.contains(origin.z() + z)) continue;
    for (int x = span_x.begin; x < span_x.end; ++x) {
      for (int y = span_y.begin; y < span_y.end; ++y)
        values_[static_cast<std::size_t>(indexOf(x, y, z))] =
            std::numeric_limits<float>::infinity();
    }
  }
}

}  // namespace vdbdither
