// The encoding of sRGB: IEC 61966-2-1.

#include "io/image/srgb.h"

#include <algorithm>
#include <cstddef>

namespace vdbdither {

namespace {

/// Newton's method from above. Unlike `std::pow`, every step is rounded in one way only.
double fifthRoot(double value) {
  double root = 1;
  for (;;) {
    const double fourth = root * root * root * root;
    const double next = root - (root - value / fourth) / 5;
    if (next >= root) return root;
    root = next;
  }
}

}  // namespace

double linearOfSrgb(double encoded) {
  if (!(encoded > 0)) return 0;
  if (encoded >= 1) return 1;
  if (encoded <= 0.04045) return encoded / 12.92;
  const double base = (encoded + 0.055) / 1.055;
  return base * base * fifthRoot(base * base);
}

const std::array<float, 256>& linearOfSrgbBytes() {
  static const std::array<float, 256> table = [] {
    std::array<float, 256> values{};
    for (std::size_t i = 0; i < values.size(); ++i)
      values[i] = static_cast<float>(linearOfSrgb(static_cast<double>(i) / 255));
    return values;
  }();
  return table;
}

std::uint8_t srgbByteOf(double linear) {
  static const auto steps = [] {
    std::array<double, 255> between{};
    for (std::size_t byte = 0; byte < between.size(); ++byte)
      between[byte] = linearOfSrgb((static_cast<double>(byte) + 0.5) / 255);
    return between;
  }();
  return static_cast<std::uint8_t>(std::upper_bound(steps.begin(), steps.end(), linear) -
                                   steps.begin());
}

}  // namespace vdbdither
