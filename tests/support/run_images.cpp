#include "tests/support/run_images.h"

#include <cmath>
#include <random>

namespace vdbdither::test {

RunImage runImage(int width, int height, const std::function<std::uint32_t(int x, int y)>& pixel) {
  RunImage image{static_cast<std::uint32_t>(width), static_cast<std::uint32_t>(height), {0}, {}};
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const std::uint32_t value = pixel(x, y);
      if (x > 0 && image.runs.back().value == value) {
        ++image.runs.back().end;
      } else {
        image.runs.push_back({static_cast<std::uint32_t>(x + 1), value});
      }
    }
    image.row_begin.push_back(image.runs.size());
  }
  return image;
}

RunImage ditheredDisc(int width, int height, double rim, std::uint32_t seed) {
  std::mt19937 random(seed);
  return runImage(width, height, [&](int x, int y) {
    const double u = (x + 0.5) / width * 2 - 1;
    const double v = (y + 0.5) / height * 2 - 1;
    const double depth = (1 - std::hypot(u, v)) * width / 2;
    return depth > 0 && depth / rim > random() / 4294967296.0 ? 1U : 0U;
  });
}

}  // namespace vdbdither::test
