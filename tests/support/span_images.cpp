#include "tests/support/span_images.h"

#include <cmath>
#include <random>

namespace vdbdither::test {

SpanImage spanImage(int width, int height,
                    const std::function<std::uint32_t(int x, int y)>& pixel) {
  SpanImage image{static_cast<std::uint32_t>(width), static_cast<std::uint32_t>(height), {0}, {}};
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const std::uint32_t value = pixel(x, y);
      if (x > 0 && image.spans.back().value == value) {
        ++image.spans.back().end;
      } else {
        image.spans.push_back({static_cast<std::uint32_t>(x + 1), value});
      }
    }
    image.row_begin.push_back(image.spans.size());
  }
  return image;
}

SpanImage ditheredDisc(int width, int height, double rim, std::uint32_t seed) {
  std::mt19937 random(seed);
  return spanImage(width, height, [&](int x, int y) {
    const double u = (x + 0.5) / width * 2 - 1;
    const double v = (y + 0.5) / height * 2 - 1;
    const double depth = (1 - std::hypot(u, v)) * width / 2;
    return depth > 0 && depth / rim > static_cast<double>(random()) / 4294967296.0 ? 1U : 0U;
  });
}

}  // namespace vdbdither::test
