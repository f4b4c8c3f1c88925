#include "ops/kernels/colour/ink_mixture.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

namespace vdbdither {

using openvdb::Vec3d;

namespace {

constexpr int steps = 4096;

}  // namespace

double rootOf(double x, double exponent) {
  constexpr int binary_digits = 52;
  if (exponent >= 1) return x;
  double power = 1;
  double root = x;
  for (int digit = 0; digit < binary_digits; ++digit) {
    root = std::sqrt(root);
    exponent *= 2;
    if (exponent >= 1) {
      power *= root;
      exponent -= 1;
    }
  }
  return power;
}

InkMixture::InkMixture(std::vector<Vec3d> linear_rgb, const Vec3d& yule_nielsen)
    : roots_(std::move(linear_rgb)) {
  for (Vec3d& ink : roots_)
    for (int channel = 0; channel < 3; ++channel)
      ink[channel] = rootOf(std::clamp(ink[channel], 0.0, 1.0), 1 / yule_nielsen[channel]);
  for (int channel = 0; channel < 3; ++channel) {
    const double n = yule_nielsen[channel];
    if (n == 2) continue;
    for (int step = 0; step <= steps; ++step) {
      const double light = static_cast<double>(step) * step / (double{steps} * steps);
      powers_[static_cast<std::size_t>(channel)].push_back(rootOf(light, 1 / n));
    }
  }
}

Vec3d InkMixture::rootsOf(const openvdb::Vec3s& linear_rgb) const {
  Vec3d roots;
  for (int channel = 0; channel < 3; ++channel) {
    const double square_root = std::sqrt(std::clamp(double{linear_rgb[channel]}, 0.0, 1.0));
    const std::vector<double>& powers = powers_[static_cast<std::size_t>(channel)];
    if (powers.empty()) {
      roots[channel] = square_root;
      continue;
    }
    const auto step = std::min(static_cast<std::size_t>(square_root * steps),
                               static_cast<std::size_t>(steps - 1));
    const double share = square_root * steps - static_cast<double>(step);
    roots[channel] = powers[step] + share * (powers[step + 1] - powers[step]);
  }
  return roots;
}

}  // namespace vdbdither
