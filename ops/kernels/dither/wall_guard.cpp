#include "ops/kernels/dither/wall_guard.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <limits>

#include "ops/kernels/leaf/floats.h"

namespace vdbdither {

using openvdb::Coord;

namespace {

/// A surface of a smaller radius does not count as a single sheet; its edges and wires do not
/// change.
constexpr double minimum_radius_mm = 0.3;

using At = LeafSurroundings;

/// Limits `values` to ±`bound`.
template <typename Lanes>
[[gnu::always_inline]] inline void clamp(Lanes& values, const Lanes& bound) {
  values = values < bound ? values : bound;
  values = values > -bound ? values : -bound;
}

/// Sets `row` to four values, or to those of two rows.
[[gnu::always_inline]] inline void join(const Floats& row, const Floats&, Floats& joined) {
  joined = row;
}
[[gnu::always_inline]] inline void join(const Floats& row, const Floats& next,
                                        EightFloats& joined) {
  joined = __builtin_shufflevector(row, next, 0, 1, 2, 3, 4, 5, 6, 7);
}

}  // namespace

/// A flat face at a voxel, and how far the distances of its neighbours may differ from those to it.
/// Distances are positive on the voxel's side.
struct WallGuard::Flat {
  std::array<float, rows> across;  ///< how much higher the middle of each row is
  float rise_z;                    ///< how much higher the next voxel along z is
  float side;                      ///< the voxel's: −1 inside, 1 outside
  float depth, half_diameter, band, rounding;
  const float* apart2;
};

/// The second rule of the guard, compiled for each instruction set.
struct WallGuard::Loops {
  template <typename Lanes>
  [[gnu::always_inline]] static bool isBent(const Flat& flat, const float* here) {
    constexpr std::size_t at_once = sizeof(Lanes) / (4 * sizeof(float));
    constexpr auto per_radius = static_cast<float>(1 / (2 * minimum_radius_mm));
    const Lanes band = Lanes{} + flat.band;
    const Floats rise_z{-flat.rise_z, 0, flat.rise_z, 0};
    auto bent = Lanes{} < Lanes{};
    for (std::size_t n = 0; n < 9; n += at_once) {
      const std::size_t next = n + at_once - 1;
      const auto row = [here](std::size_t m) {
        const int i = static_cast<int>(m) / 3 - 1;
        const int j = static_cast<int>(m) % 3 - 1;
        return here + (m < 9 ? i * At::stride_x + j * At::stride_y : At::stride_x + At::stride_y) -
               1;
      };
      Lanes rise, there, apart2;
      join(rise_z + flat.across[n], rise_z + flat.across[next], rise);
      join(loadFloats(row(n)), loadFloats(row(next)), there);
      join(loadFloats(flat.apart2 + 4 * n), loadFloats(flat.apart2 + 4 * next), apart2);
      Lanes expected = rise + flat.depth;
      clamp(expected, band);
      there *= flat.side;
      clamp(there, band);
      const Lanes nearer = expected < there ? expected : there;
      const Lanes farther = expected > there ? expected : there;
      const Lanes bend = (apart2 - rise * rise) * per_radius + flat.rounding;
      bent |= (nearer < flat.half_diameter) & (farther - nearer > bend);
    }
    std::array<std::uint64_t, 2 * at_once> words;
    static_assert(sizeof words == sizeof bent);
    std::memcpy(&words, &bent, sizeof bent);
    return std::any_of(words.begin(), words.end(), [](std::uint64_t word) { return word != 0; });
  }

  static bool isBentBaseline(const Flat& flat, const float* here) {
    return isBent<Floats>(flat, here);
  }

#if defined(__x86_64__)
  [[gnu::target("avx2")]] static bool isBentAvx2(const Flat& flat, const float* here) {
    return isBent<EightFloats>(flat, here);
  }
#endif
};

WallGuard::WallGuard(const openvdb::FloatTree& surface, const openvdb::Vec3d& pitch_mm,
                     float background_mm, ZRange valid,
                     [[maybe_unused]] InstructionSet instructions)
    : surface_(surface),
      pitch_mm_(pitch_mm),
      background_mm_(background_mm),
      valid_(valid),
      is_bent_(&Loops::isBentBaseline) {
#if defined(__x86_64__)
  if (instructions == InstructionSet::avx2) is_bent_ = &Loops::isBentAvx2;
#endif
  constexpr float idle = 1e9F;  // never bent
  const auto along2 = static_cast<float>(pitch_mm.z() * pitch_mm.z());
  for (std::size_t n = 0; n < rows; ++n) {
    const auto [i, j] = std::div(static_cast<int>(std::min<std::size_t>(n, 8)), 3);
    const auto across2 = static_cast<float>(pitch_mm.x() * pitch_mm.x() * ((i - 1) * (i - 1)) +
                                            pitch_mm.y() * pitch_mm.y() * ((j - 1) * (j - 1)));
    storeFloats(&apart2_[4 * n], Floats{along2, 0, along2, idle} + across2);
  }
}

bool WallGuard::allows(const LeafSurroundings& around, const Coord& origin, unsigned offset,
                       const openvdb::Vec3s& normal, float d_mm, double half_diameter_mm) {
  openvdb::Vec3d rise_mm;
  for (int axis = 0; axis < 3; ++axis)
    rise_mm[axis] = std::abs(double{normal[axis]}) * pitch_mm_[axis];
  const double highest_mm = std::max({rise_mm[0], rise_mm[1], rise_mm[2]});
  if (highest_mm == 0) return false;
  const double band_mm = std::min(std::max(highest_mm, 2 * half_diameter_mm), background_mm_);

  Coord outward(0);
  double rise_all_mm = 0;
  for (int axis = 0; axis < 3; ++axis) {
    // Ignores components that are rounding errors of a flat facet's normal.
    if (rise_mm[axis] < 1e-3 * highest_mm) continue;
    outward[axis] = normal[axis] > 0 ? 1 : -1;
    rise_all_mm += rise_mm[axis];
  }

  const double depth_mm = std::abs(double{d_mm});
  const int own = d_mm < 0 ? -1 : 1;  // the side that the voxel lies on
  const float* here = around.at(offset);
  // The distance of the voxel n steps outward, positive on the given side.
  const int step = outward.x() * At::stride_x + outward.y() * At::stride_y + outward.z();
  const auto sample = [&](int side, int n) {
    const double d = std::abs(n) <= At::halo
                         ? double{here[n * step]}
                         : distance(origin + FloatLeaf::offsetToLocalCoord(offset) +
                                    Coord(n * outward.x(), n * outward.y(), n * outward.z()));
    return std::clamp(side * d, -band_mm, band_mm);
  };

  // T on the voxel's own side, one step further in; then across the face, by the steps that are
  // needed to tell thick from thin.
  const int steps = 1 + static_cast<int>(1.5 * depth_mm / rise_all_mm + 0.95);
  if (sample(own, own) < half_diameter_mm) return false;
  const double beyond_mm = sample(-own, -own * steps);
  if (beyond_mm <= -band_mm ||
      beyond_mm < 2 * depth_mm + half_diameter_mm - (steps - 1) * rise_all_mm)
    return false;

  const double rise_x = own * (double{normal[0]} * pitch_mm_[0]);
  const double rise_y = own * (double{normal[1]} * pitch_mm_[1]);
  const auto along_x = static_cast<float>(rise_x);
  const auto along_y = static_cast<float>(rise_y);
  const auto both = static_cast<float>(rise_x + rise_y);
  const auto apart = static_cast<float>(rise_x - rise_y);
  return !is_bent_({{-both, -along_x, -apart, -along_y, 0, along_y, apart, along_x, both, both},
                    static_cast<float>(own * (double{normal[2]} * pitch_mm_[2])),
                    static_cast<float>(own),
                    static_cast<float>(depth_mm),
                    static_cast<float>(half_diameter_mm),
                    static_cast<float>(band_mm),
                    static_cast<float>(0.02 * rise_all_mm),
                    apart2_.data()},
                   here);
}

double WallGuard::distance(const Coord& ijk) {
  constexpr double none = std::numeric_limits<double>::infinity();
  float value = 0;
  if (!valid_.contains(ijk.z())) return none;
  return surface_.probeValue(ijk, value) ? double{value} : std::copysign(none, double{value});
}

}  // namespace vdbdither
