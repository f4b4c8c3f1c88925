#include "ops/kernels/dither/tone_curve.h"

#include <algorithm>
#include <cmath>

#include "ops/kernels/printing/normal_distribution.h"

namespace vdbdither {

ToneCurve::ToneCurve() {
  // Rounded, so that the last bits of the library's function do not matter.
  constexpr double unit = 1 << 30;
  const auto share = [](std::size_t n) {
    return std::nearbyint(normalShare(static_cast<double>(n) / cells_per_unit - maximum) * unit) /
           unit;
  };
  for (std::size_t n = 0; n < cells_.size(); ++n) cells_[n] = {share(n), share(n + 1) - share(n)};
}

}  // namespace vdbdither
