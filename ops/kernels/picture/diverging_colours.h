#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

namespace vdbdither {

/// Returns the sRGB colour of `value` between −1 (blue), 0 (light grey) and 1 (red), interpolated
/// linearly between the ends and the middle of Moreland's "Diverging Color Maps for Scientific
/// Visualization", 2009. Values beyond the ends get the colour of the end.
inline std::array<std::uint8_t, 3> divergingColour(double value) {
  constexpr std::array<double, 3> low{59, 76, 192};
  constexpr std::array<double, 3> middle{221, 221, 221};
  constexpr std::array<double, 3> high{180, 4, 38};
  const double share = std::clamp(std::abs(value), 0.0, 1.0);
  const auto& end = value < 0 ? low : high;
  std::array<std::uint8_t, 3> colour{};
  for (std::size_t n = 0; n < 3; ++n)
    colour[n] = static_cast<std::uint8_t>(std::lround(middle[n] + share * (end[n] - middle[n])));
  return colour;
}

}  // namespace vdbdither
