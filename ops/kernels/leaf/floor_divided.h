#pragma once

namespace vdbdither {

/// Returns the floor of a / b, also for negative a. `b` must be positive.
constexpr int floorDivided(int a, int b) { return a / b - (a % b < 0 ? 1 : 0); }

}  // namespace vdbdither
