#include "ops/kernels/colour/texture_coverage.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace vdbdither {

namespace {

constexpr std::uint8_t full = 255;

struct Point {
  double x, y;
};
struct Interval {
  double low = std::numeric_limits<double>::infinity();
  double high = -std::numeric_limits<double>::infinity();

  void include(double x) {
    low = std::min(low, x);
    high = std::max(high, x);
  }
};

/// The extent along x of the part of a triangle between two heights.
Interval extentBetween(const std::array<Point, 3>& corners, double low, double high) {
  Interval extent;
  for (std::size_t c = 0; c < 3; ++c) {
    const Point& a = corners[c];
    const Point& b = corners[(c + 1) % 3];
    if (a.y >= low && a.y <= high) extent.include(a.x);
    for (const double y : {low, high})
      if ((a.y < y) != (b.y < y)) extent.include(a.x + (b.x - a.x) * (y - a.y) / (b.y - a.y));
  }
  return extent;
}

}  // namespace

std::uint32_t wrappedTexel(std::int64_t at, std::uint32_t size, TextureWrap wrap) {
  const std::int64_t count = size;
  if (at >= 0 && at < count) return static_cast<std::uint32_t>(at);
  if (wrap == TextureWrap::clamp) return at < 0 ? 0 : size - 1;
  const std::int64_t period = wrap == TextureWrap::mirror ? 2 * count : count;
  const std::int64_t within = (at % period + period) % period;
  return static_cast<std::uint32_t>(within < count ? within : period - 1 - within);
}

void TextureCoverage::add(const Appearance::Coordinates& corners,
                          const std::array<TextureWrap, 2>& wrap) {
  std::array<Point, 3> at{};
  Interval across;
  Interval down;
  for (std::size_t c = 0; c < 3; ++c) {
    at[c] = {double{corners[c].x()} * width_, double{corners[c].y()} * height_};
    across.include(at[c].x);
    down.include(at[c].y);
  }
  // Beyond these all texels are shown, or coordinates have lost their meaning.
  constexpr double far = 1e9;
  const bool is_near = across.low > -far && across.high < far && down.low > -far && down.high < far;
  if (!is_near || across.high - across.low > 2.0 * width_ || down.high - down.low > 2.0 * height_) {
    std::fill(shown_.begin(), shown_.end(), full);
    return;
  }
  const auto last_row = static_cast<std::int64_t>(std::floor(down.high)) + 1;
  for (auto row = static_cast<std::int64_t>(std::floor(down.low)) - 1; row <= last_row; ++row) {
    const auto y = static_cast<double>(row);
    const Interval extent = extentBetween(at, y - 1, y + 2);
    if (!(extent.low <= extent.high)) continue;
    std::uint8_t* texels =
        shown_.data() + std::size_t{wrappedTexel(row, height_, wrap[1])} * width_;
    const auto last = static_cast<std::int64_t>(std::floor(extent.high)) + 1;
    for (auto column = static_cast<std::int64_t>(std::floor(extent.low)) - 1; column <= last;
         ++column)
      texels[wrappedTexel(column, width_, wrap[0])] = full;
  }
}

}  // namespace vdbdither
