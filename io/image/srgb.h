#pragma once

#include <array>

namespace vdbdither {

/// Returns the linear light of a value in the encoding of sRGB, both 0 … 1. Values outside are
/// clipped, NaN gives 0. The result is the same on every machine.
double linearOfSrgb(double encoded);

/// Returns the same for every byte.
const std::array<float, 256>& linearOfSrgbBytes();

}  // namespace vdbdither
