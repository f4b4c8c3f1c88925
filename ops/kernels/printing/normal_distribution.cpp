#include "ops/kernels/printing/normal_distribution.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace vdbdither {

double normalShare(double x) { return 0.5 * std::erfc(-x / std::numbers::sqrt2); }

double probit(double share) {
  constexpr double minimum = 1e-12;
  // The formula for the tail of Abramowitz and Stegun, 26.2.23, then steps of Newton's and Halley's
  // methods.
  const double tail = std::max(minimum, std::min(share, 1 - share));
  const double t = std::sqrt(-2 * std::log(tail));
  const double rough = t - (2.515517 + t * (0.802853 + t * 0.010328)) /
                               (1 + t * (1.432788 + t * (0.189269 + t * 0.001308)));
  double x = -rough;
  for (int step = 0; step < 2; ++step) {
    const double density =
        std::exp(-0.5 * x * x) / (std::numbers::sqrt2 / std::numbers::inv_sqrtpi);
    const double off = (normalShare(x) - tail) / density;
    x -= off / (1 + 0.5 * x * off);
  }
  return share < 0.5 ? x : -x;
}

}  // namespace vdbdither
