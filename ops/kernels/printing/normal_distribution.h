#pragma once

namespace vdbdither {

/// Returns Φ(x), the share of the standard normal distribution below x.
double normalShare(double x);

/// Returns the inverse of Φ. `share` is clamped to [10⁻¹², 1 − 10⁻¹²].
double probit(double share);

}  // namespace vdbdither
