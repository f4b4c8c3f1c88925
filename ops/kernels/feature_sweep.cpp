// The innermost loop of the distance field: a feature against the columns of a leaf. One source is
// compiled for the baseline and for AVX2; without contraction both round every operation alike.

#include "ops/kernels/feature_sweep.h"

#include <algorithm>
#include <cmath>

namespace vdbdither {

namespace {

constexpr int edge = 8;

/// `Lanes` and `Flags` are vectors of as many doubles and 64-bit integers as fit one register.
template <class Lanes, class Flags, bool track>
[[gnu::always_inline]] inline void sweep(const LeafFeature& feature, std::int64_t name,
                                         LeafDistances& leaf) {
  constexpr int width = sizeof(Lanes) / sizeof(double);
  constexpr int parts = edge / width;

  const int rank = feature.rank;
  const int forms = feature.forms;
  Lanes rise[LeafFeature::max_forms][parts];
  double reach[LeafFeature::max_forms];  // how much a bound gains along its column at best
  double inverse_y[LeafFeature::max_forms];
  for (int f = 0; f < forms; ++f) {
    for (int part = 0; part < parts; ++part)
      for (int lane = 0; lane < width; ++lane)
        rise[f][part][lane] = feature.z[f] * (part * width + lane);
    reach[f] = std::max(0.0, feature.z[f] * (edge - 1));
    inverse_y[f] = 1 / feature.y[f];
  }

  for (int i = feature.i_begin; i < feature.i_end; ++i) {
    double row[LeafFeature::max_forms];
    double j_low = feature.j_begin;
    double j_high = feature.j_end - 1;
    for (int f = 0; f < forms; ++f) {
      row[f] = feature.constant[f] + feature.x[f] * i;
      if (f < rank) continue;
      const double best = row[f] + reach[f];
      if (feature.y[f] > 0) {
        j_low = std::max(j_low, -best * inverse_y[f]);
      } else if (feature.y[f] < 0) {
        j_high = std::min(j_high, -best * inverse_y[f]);
      } else if (best < 0) {
        j_high = -1;
      }
    }
    if (!(j_low <= j_high)) continue;
    const int j_last = static_cast<int>(j_high);
    for (int j = static_cast<int>(std::ceil(j_low)); j <= j_last; ++j) {
      double column[LeafFeature::max_forms];
      for (int f = 0; f < forms; ++f) column[f] = row[f] + feature.y[f] * j;
      const int offset = (i * edge + j) * edge;
      for (int part = 0; part < parts; ++part) {
        Lanes form = rise[0][part] + column[0];
        Lanes squared = form * form;
        for (int f = 1; f < rank; ++f) {
          form = rise[f][part] + column[f];
          squared += form * form;
        }
        auto& best = *reinterpret_cast<Lanes*>(leaf.squared + offset + part * width);
        Flags take = squared < best;
        for (int f = rank; f < forms; ++f) take &= (rise[f][part] + column[f]) >= 0;
        best = take ? squared : best;
        if constexpr (track) {
          auto& nearest = *reinterpret_cast<Flags*>(leaf.nearest + offset + part * width);
          nearest = take ? Flags{} + name : nearest;
        }
      }
    }
  }
}

// Vectors of this size alias the arrays they are laid over.
using Lanes2 = double __attribute__((vector_size(16), may_alias));
using Flags2 = long long __attribute__((vector_size(16), may_alias));
using Lanes4 = double __attribute__((vector_size(32), may_alias));
using Flags4 = long long __attribute__((vector_size(32), may_alias));

template <bool track>
void sweepPortable(const LeafFeature& feature, std::int64_t name, LeafDistances& leaf) {
  sweep<Lanes2, Flags2, track>(feature, name, leaf);
}

#if defined(__x86_64__)
template <bool track>
__attribute__((target("avx2"))) void sweepAvx2(const LeafFeature& feature, std::int64_t name,
                                               LeafDistances& leaf) {
  sweep<Lanes4, Flags4, track>(feature, name, leaf);
}
#endif

}  // namespace

FeatureSweep portableFeatureSweep(bool track) {
  return track ? &sweepPortable<true> : &sweepPortable<false>;
}

FeatureSweep featureSweep(bool track) {
#if defined(__x86_64__)
  if (__builtin_cpu_supports("avx2")) return track ? &sweepAvx2<true> : &sweepAvx2<false>;
#endif
  return portableFeatureSweep(track);
}

}  // namespace vdbdither
