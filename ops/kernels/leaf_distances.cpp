// One source is compiled for the baseline and for AVX2. Without contraction both round every
// operation alike.

#include "ops/kernels/leaf_distances.h"

#include <algorithm>
#include <cmath>

namespace vdbdither {

namespace {

constexpr int edge = 8;

// Vectors that fit one register; they alias the arrays that they are laid over.
struct Portable {
  using Lanes = double __attribute__((vector_size(16), may_alias));
  using Flags = std::int64_t __attribute__((vector_size(16), may_alias));
  static constexpr Lanes ramp{0, 1};
};
struct Avx2 {
  using Lanes = double __attribute__((vector_size(32), may_alias));
  using Flags = std::int64_t __attribute__((vector_size(32), may_alias));
  static constexpr Lanes ramp{0, 1, 2, 3};
};

/// `rank` and `fixed_count` at compile time let the forms stay in registers; a count of zero stands
/// for any.
template <class Set, int rank, int fixed_count, bool track>
[[gnu::always_inline]] inline void lowerBy(const LatticeFeature& feature,
                                           const openvdb::Coord& origin, std::int64_t name,
                                           LeafDistances& leaf) {
  using Lanes = typename Set::Lanes;
  using Flags = typename Set::Flags;
  constexpr int width = sizeof(Lanes) / sizeof(double);
  constexpr int parts = edge / width;
  constexpr int capacity = fixed_count > 0 ? fixed_count : 3 + MeshFeature::max_bounds;
  const int count = fixed_count > 0 ? fixed_count : feature.count;

  const int i_begin = std::max(feature.reach.min().x() - origin.x(), 0);
  const int i_end = std::min(feature.reach.max().x() - origin.x() + 1, edge);
  const int j_begin = std::max(feature.reach.min().y() - origin.y(), 0);
  const int j_end = std::min(feature.reach.max().y() - origin.y() + 1, edge);
  // Whole vectors of the widest set, so that every set visits the same voxels.
  const int k_begin = std::max(feature.reach.min().z() - origin.z(), 0) & ~3;
  const int k_end = (std::min(feature.reach.max().z() - origin.z() + 1, edge) + 3) & ~3;

  double x[capacity], y[capacity], constant[capacity];
  double inverse_y[capacity], most[capacity], least[capacity];  // of a bound along its column
  Lanes rise[capacity][parts];
  for (int f = 0; f < count; ++f) {
    const LinearForm& form = feature.forms[f];
    x[f] = form.gradient.x();
    y[f] = form.gradient.y();
    constant[f] = form.at(origin.asVec3d());
    for (int part = 0; part < parts; ++part)
      rise[f][part] = (Set::ramp + static_cast<double>(part * width)) * form.gradient.z();
    inverse_y[f] = 1 / y[f];
    const double first = form.gradient.z() * k_begin;
    const double last = form.gradient.z() * (k_end - 1);
    least[f] = std::min(first, last);
    most[f] = std::max(first, last);
  }
  for (int i = i_begin; i < i_end; ++i) {
    double row[capacity];
    double j_low = j_begin;
    double j_high = j_end - 1;
    for (int f = 0; f < count; ++f) row[f] = constant[f] + x[f] * i;
    // Columns that cannot be within the band of the plane or line, or that miss a bound, are left
    // out.
    const auto keep = [&](double best, double slope, double inverse_slope)
        __attribute__((always_inline)) {
      const double zero = -best * inverse_slope;
      if (slope > 0) {
        j_low = std::max(j_low, zero);
      } else if (slope < 0) {
        j_high = std::min(j_high, zero);
      } else if (best < 0) {
        j_high = -1;
      }
    };
    for (int f = 0; f < rank && rank < 3; ++f) {
      keep(feature.band_mm + row[f] + most[f], y[f], inverse_y[f]);
      keep(feature.band_mm - row[f] - least[f], -y[f], -inverse_y[f]);
    }
    for (int f = rank; f < count; ++f) keep(row[f] + most[f], y[f], inverse_y[f]);
    if (!(j_low <= j_high)) continue;
    const int j_last = static_cast<int>(j_high);
    for (int j = static_cast<int>(std::ceil(j_low)); j <= j_last; ++j) {
      double column[capacity];
      for (int f = 0; f < count; ++f) column[f] = row[f] + y[f] * j;
      for (int part = k_begin / width; part * width < k_end; ++part) {
        Lanes squared{};
        for (int f = 0; f < rank; ++f) {
          const Lanes form = rise[f][part] + column[f];
          squared += form * form;
        }
        const int offset = (i * edge + j) * edge + part * width;
        auto& best = *reinterpret_cast<Lanes*>(leaf.squared + offset);
        Flags take = squared < best;
        for (int f = rank; f < count; ++f) take &= (rise[f][part] + column[f]) >= 0;
        best = take ? squared : best;
        if constexpr (track) {
          auto& nearest = *reinterpret_cast<Flags*>(leaf.nearest + offset);
          nearest = take ? Flags{} + name : nearest;
        }
      }
    }
  }
}

template <class Set, bool track>
[[gnu::always_inline]] inline void lowerAny(const LatticeFeature& feature,
                                            const openvdb::Coord& origin, std::int64_t name,
                                            LeafDistances& leaf) {
  if (feature.rank == 1) {
    lowerBy<Set, 1, 4, track>(feature, origin, name, leaf);
  } else if (feature.rank == 2 && feature.count == 6) {
    lowerBy<Set, 2, 6, track>(feature, origin, name, leaf);
  } else if (feature.rank == 2) {
    lowerBy<Set, 2, 0, track>(feature, origin, name, leaf);
  } else {
    lowerBy<Set, 3, 0, track>(feature, origin, name, leaf);
  }
}

template <class Set>
[[gnu::always_inline]] inline LeafBits finishAll(const LeafDistances& leaf, const LeafBits& inside,
                                                 const LeafBits& exists, double limit_mm,
                                                 float background_mm, float* values) {
  using Lanes = typename Set::Lanes;
  using Flags = typename Set::Flags;
  constexpr int width = sizeof(Lanes) / sizeof(double);
  Flags bit;
  for (int lane = 0; lane < width; ++lane) bit[lane] = std::int64_t{1} << lane;
  alignas(64) double roots[LeafDistances::voxels];
  for (int v = 0; v < LeafDistances::voxels; ++v) roots[v] = std::sqrt(leaf.squared[v]);

  LeafBits active;
  const Lanes background = Lanes{} + double{background_mm};
  for (std::size_t plane = 0; plane < edge; ++plane) {
    std::uint64_t found = 0;
    for (int v = 0; v < 64; v += width) {
      const int offset = static_cast<int>(plane) * 64 + v;
      const auto& root = *reinterpret_cast<const Lanes*>(roots + offset);
      const auto existing = Flags{} + static_cast<std::int64_t>(exists[plane] >> v);
      const auto within = Flags{} + static_cast<std::int64_t>(inside[plane] >> v);
      const Flags on = (root < limit_mm) & ((existing & bit) != 0);
      const Lanes magnitude = on ? root : background;
      const Lanes value = (within & bit) != 0 ? Lanes{} - magnitude : magnitude;
      const Flags marks = on & bit;
      std::int64_t mark = 0;
      for (int lane = 0; lane < width; ++lane) {
        mark |= marks[lane];
        values[offset + lane] = static_cast<float>(value[lane]);
      }
      found |= static_cast<std::uint64_t>(mark) << v;
    }
    active[plane] = found;
  }
  return active;
}

void lowerPortable(const LatticeFeature& feature, const openvdb::Coord& origin, std::int64_t name,
                   bool track, LeafDistances& leaf) {
  track ? lowerAny<Portable, true>(feature, origin, name, leaf)
        : lowerAny<Portable, false>(feature, origin, name, leaf);
}

LeafBits finishPortable(const LeafDistances& leaf, const LeafBits& inside, const LeafBits& exists,
                        double limit_mm, float background_mm, float* values) {
  return finishAll<Portable>(leaf, inside, exists, limit_mm, background_mm, values);
}

#if defined(__x86_64__)
__attribute__((target("avx2"))) void lowerAvx2(const LatticeFeature& feature,
                                               const openvdb::Coord& origin, std::int64_t name,
                                               bool track, LeafDistances& leaf) {
  track ? lowerAny<Avx2, true>(feature, origin, name, leaf)
        : lowerAny<Avx2, false>(feature, origin, name, leaf);
}

__attribute__((target("avx2"))) LeafBits finishAvx2(const LeafDistances& leaf,
                                                    const LeafBits& inside, const LeafBits& exists,
                                                    double limit_mm, float background_mm,
                                                    float* values) {
  return finishAll<Avx2>(leaf, inside, exists, limit_mm, background_mm, values);
}
#endif

}  // namespace

const LeafKernels& portableLeafKernels() {
  static const LeafKernels kernels{&lowerPortable, &finishPortable};
  return kernels;
}

const LeafKernels& leafKernels() {
#if defined(__x86_64__)
  static const LeafKernels avx2{&lowerAvx2, &finishAvx2};
  if (__builtin_cpu_supports("avx2")) return avx2;
#endif
  return portableLeafKernels();
}

}  // namespace vdbdither
