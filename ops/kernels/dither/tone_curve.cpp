#include "ops/kernels/dither/tone_curve.h"

#include <algorithm>
#include <cmath>

#include "ops/kernels/printing/normal_distribution.h"

namespace vdbdither {

namespace {

/// A larger share leaves weaker stripes where steps are high, and more error after a blur of 2σ.
constexpr double level_share = 0.68;

}  // namespace

ToneCurve::ToneCurve() {
  // Rounded, so that the last bits of the library's function do not matter.
  constexpr double unit = 1 << 30;
  for (std::size_t n = 0; n < shares_.size(); ++n) {
    const double x = static_cast<double>(n) / cells_per_unit - maximum;
    shares_[n] = std::nearbyint(normalShare(x) * unit) / unit;
  }
}

double ToneCurve::share(double x) const {
  const double at = (std::clamp(x, -double{maximum}, double{maximum}) + maximum) * cells_per_unit;
  const auto cell = static_cast<std::size_t>(at);
  return shares_[cell] + (at - static_cast<double>(cell)) * (shares_[cell + 1] - shares_[cell]);
}

float ToneCurve::operator()(float d_mm, double half_diameter_mm, double spread_mm) const {
  const double bottom = (double{d_mm} - half_diameter_mm) / spread_mm;
  const double below = share(bottom);
  const double step = share(bottom + 2 * half_diameter_mm / spread_mm) - below;
  const double coverage = 0.5 - double{d_mm} / (2 * half_diameter_mm);
  const double level = step > 0 ? (0.5 - below) / step : coverage;
  return static_cast<float>(std::clamp(coverage + level_share * (level - coverage), 0.0, 1.0));
}

}  // namespace vdbdither
