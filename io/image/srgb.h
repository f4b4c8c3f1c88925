#pragma once

#include <array>
#include <cstdint>

namespace vdbdither {

/// Returns the linear light of a value in the encoding of sRGB, both 0 … 1. Values outside are
/// clipped, NaN gives 0. The result is the same on every machine.
double linearOfSrgb(double encoded);

/// Returns the same for every byte.
const std::array<float, 256>& linearOfSrgbBytes();

/// Returns the byte in the encoding of sRGB nearest to `linear` light, 0 … 1. Values outside are
/// clipped. The result is the same on every machine.
std::uint8_t srgbByteOf(double linear);

}  // namespace vdbdither
