#pragma once

namespace vdbdither {

/// Φ(x), the share of the standard normal distribution below x.
double normalShare(double x);

/// The inverse of Φ. What is not within (10⁻¹², 1 − 10⁻¹²) counts as the nearer of these.
double probit(double share);

}  // namespace vdbdither
