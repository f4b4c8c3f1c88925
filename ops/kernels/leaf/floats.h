#pragma once

#ifdef __SSE2__
#include <emmintrin.h>
#endif

#include <cstring>

namespace vdbdither {

/// Four floats that are computed together; every lane has the bits that a float would have.
using Floats = float __attribute__((vector_size(16)));
/// Eight floats, for code that is compiled for AVX2. Such values are passed by reference only: how
/// they are passed by value depends on the instruction set.
using EightFloats = float __attribute__((vector_size(32)));
/// Four doubles, in two registers of the baseline. They are passed by reference only, too.
using Doubles = double __attribute__((vector_size(32)));

/// Sets `values`, Floats or EightFloats, to those from `from` on.
template <typename Lanes>
[[gnu::always_inline]] inline void loadLanes(const float* from, Lanes& values) {
  std::memcpy(&values, from, sizeof values);
}

/// The four values from `from` on.
inline Floats loadFloats(const float* from) {
  Floats values;
  std::memcpy(&values, from, sizeof values);
  return values;
}

/// Writes them from `to` on.
inline void storeFloats(float* to, Floats values) { std::memcpy(to, &values, sizeof values); }

/// The lesser of each two; of values that are neither NaN nor zeros of different signs.
inline Floats lesserOf(Floats a, Floats b) {
#ifdef __SSE2__
  return _mm_min_ps(a, b);
#else
  return a < b ? a : b;
#endif
}

/// The greater of each two; of values that are neither NaN nor zeros of different signs.
inline Floats greaterOf(Floats a, Floats b) {
#ifdef __SSE2__
  return _mm_max_ps(a, b);
#else
  return a > b ? a : b;
#endif
}

}  // namespace vdbdither
