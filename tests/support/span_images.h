#pragma once

#include <cstdint>
#include <functional>

#include "vdbdither/model/span_image.h"

namespace vdbdither::test {

/// Returns the image whose pixel in column x of row y is `pixel(x, y)`.
SpanImage spanImage(int width, int height, const std::function<std::uint32_t(int x, int y)>& pixel);

/// Returns a disc of value 1 on 0 that fills the image. Within `rim` pixels of its edge the
/// probability of 1 rises inwards from 0 to 1, as in a slice through a dithered slope.
SpanImage ditheredDisc(int width, int height, double rim, std::uint32_t seed);

}  // namespace vdbdither::test
