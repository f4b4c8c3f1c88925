#pragma once

#include <cstdint>

namespace vdbdither {

// SplitMix64: Steele, Lea, Flood: Fast Splittable Pseudorandom Number Generators, 2014. The same
// numbers on every machine.

/// What the state grows by for each number.
inline constexpr std::uint64_t split_mix_step = 0x9E3779B97F4A7C15U;

/// Returns a number whose bits all depend on all of `bits`: the finalizer of SplitMix64.
constexpr std::uint64_t scattered(std::uint64_t bits) {
  bits = (bits ^ (bits >> 30U)) * 0xBF58476D1CE4E5B9U;
  bits = (bits ^ (bits >> 27U)) * 0x94D049BB133111EBU;
  return bits ^ (bits >> 31U);
}

/// Returns the number that SplitMix64 makes of a state.
constexpr std::uint64_t splitMix(std::uint64_t state) { return scattered(state + split_mix_step); }

}  // namespace vdbdither
