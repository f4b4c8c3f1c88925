#pragma once

#include <cstdint>
#include <functional>

#include "vdbdither/model/run_image.h"

namespace vdbdither::test {

/// The image whose pixel in column x of row y is `pixel(x, y)`.
RunImage runImage(int width, int height, const std::function<std::uint32_t(int x, int y)>& pixel);

/// A disc of value 1 on 0 that fills the image; over `rim` pixels inwards from its edge its pixels
/// grow from rare to certain, as in a slice through a dithered slope.
RunImage ditheredDisc(int width, int height, double rim, std::uint32_t seed);

}  // namespace vdbdither::test
