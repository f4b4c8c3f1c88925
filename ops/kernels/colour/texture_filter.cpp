// Textures are averaged in a pyramid (L. Williams, "Pyramidal parametrics", SIGGRAPH 1983) at
// several places of a parallelogram (J. McCormack, R. Perry, K. Farkas, N. Jouppi, "Feline: fast
// elliptical lines for anisotropic texture mapping", SIGGRAPH 1999).

#include "ops/kernels/colour/texture_filter.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <utility>

#include <tbb/parallel_for.h>

#include "ops/kernels/colour/texture_coverage.h"

namespace vdbdither {

using openvdb::Vec2d;
using openvdb::Vec2f;
using openvdb::Vec4f;

namespace {

/// How far a parallelogram may reach on a level, in its texels, and how many samples it has for
/// each of them. The texture itself may change from texel to texel; its copies are smoother, but
/// their texels, which are squares, must be small beside the parallelogram.
struct LevelLimits {
  double across, along, samples_per_texel;
};
constexpr LevelLimits limits_of_texture{2, 32, 2};
constexpr LevelLimits limits_of_copies{4, 64, 1};

/// The texels of a row or column that one of the next level covers, and how much of each.
struct Cover {
  std::uint32_t begin, end;
  std::uint64_t first, last;  ///< shares of the first and the last texel, of `whole`
  std::uint64_t whole;
};

Cover coverOf(std::uint32_t at, std::uint32_t size, std::uint32_t next_size) {
  const std::uint64_t low = std::uint64_t{at} * size;  // in parts of 1 / next_size
  const std::uint64_t high = low + size;
  const auto begin = static_cast<std::uint32_t>(low / next_size);
  const auto end = static_cast<std::uint32_t>((high + next_size - 1) / next_size);
  const std::uint64_t first = std::min((begin + std::uint64_t{1}) * next_size, high) - low;
  const std::uint64_t last = end - begin > 1 ? high - (end - std::uint64_t{1}) * next_size : first;
  return {begin, end, first, last, next_size};
}

std::uint64_t shareOf(const Cover& cover, std::uint32_t at) {
  if (at == cover.begin) return cover.first;
  return at + 1 == cover.end ? cover.last : cover.whole;
}

/// Returns the image with half as many texels along each side, rounded up.
/// @param weights  of the texels; becomes that of the texels of the result
Texture halved(const Texture& image, std::vector<std::uint8_t>& weights) {
  Texture half;
  half.width = (image.width + 1) / 2;
  half.height = (image.height + 1) / 2;
  half.texels.resize(std::size_t{half.width} * half.height);
  std::vector<std::uint8_t> half_weights(half.texels.size());
  const std::uint64_t area = std::uint64_t{image.width} * image.height;
  tbb::parallel_for(std::uint32_t{0}, half.height, [&](std::uint32_t y) {
    const Cover rows = coverOf(y, image.height, half.height);
    for (std::uint32_t x = 0; x < half.width; ++x) {
      const Cover columns = coverOf(x, image.width, half.width);
      std::array<std::uint64_t, 4> sum{};
      std::uint64_t weight = 0;
      for (std::uint32_t row = rows.begin; row < rows.end; ++row)
        for (std::uint32_t column = columns.begin; column < columns.end; ++column) {
          const std::size_t at = std::size_t{row} * image.width + column;
          const std::uint64_t share = shareOf(rows, row) * shareOf(columns, column) * weights[at];
          weight += share;
          for (std::size_t c = 0; c < 4; ++c) sum[c] += share * image.texels[at][c];
        }
      if (weight == 0) continue;
      const std::size_t made = std::size_t{y} * half.width + x;
      for (std::size_t c = 0; c < 4; ++c)
        half.texels[made][c] = static_cast<std::uint16_t>((sum[c] + weight / 2) / weight);
      half_weights[made] = static_cast<std::uint8_t>(std::max<std::uint64_t>(1, weight / area));
    }
  });
  weights = std::move(half_weights);
  return half;
}

/// Gives texels without a weight the colour of the smaller copy.
void fillFrom(const Texture& smaller, const std::vector<std::uint8_t>& weights, Texture& image) {
  for (std::uint32_t y = 0; y < image.height; ++y)
    for (std::uint32_t x = 0; x < image.width; ++x) {
      const std::size_t at = std::size_t{y} * image.width + x;
      if (weights[at] == 0)
        image.texels[at] = smaller.texels[std::size_t{y / 2} * smaller.width + x / 2];
    }
}

/// The largest whole number that is not above `at`. Coordinates far outside of the texture, of
/// which nothing meaningful is left, stay in range.
std::int64_t wholeOf(double at) {
  constexpr double far = 1e15;
  at = std::clamp(at, -far, far);
  const auto whole = static_cast<std::int64_t>(at);
  return whole - (static_cast<double>(whole) > at ? 1 : 0);
}

/// Red, green, blue and the opacity, in parts of 65535.
using Colour = float __attribute__((vector_size(16)));

Colour colourOf(const Texture::Texel& texel) {
  using Parts = std::uint16_t __attribute__((vector_size(8)));
  return __builtin_convertvector(std::bit_cast<Parts>(texel), Colour);
}

Colour texelAt(const Texture& image, std::int64_t x, std::int64_t y,
               const std::array<TextureWrap, 2>& wrap) {
  return colourOf(image.texels[std::size_t{wrappedTexel(y, image.height, wrap[1])} * image.width +
                               wrappedTexel(x, image.width, wrap[0])]);
}

Colour interpolated(const Texture& image, double u, double v,
                    const std::array<TextureWrap, 2>& wrap) {
  const double x = u * image.width - 0.5;
  const double y = v * image.height - 0.5;
  const std::int64_t column = wholeOf(x);
  const std::int64_t row = wholeOf(y);
  const auto right = static_cast<float>(x - static_cast<double>(column));
  const auto lower = static_cast<float>(y - static_cast<double>(row));
  std::array<Colour, 4> corners;
  const bool is_within = column >= 0 && column + 1 < std::int64_t{image.width} && row >= 0 &&
                         row + 1 < std::int64_t{image.height};
  if (is_within) {
    const Texture::Texel* texel = image.texels.data() +
                                  static_cast<std::size_t>(row) * image.width +
                                  static_cast<std::size_t>(column);
    corners = {colourOf(texel[0]), colourOf(texel[1]), colourOf(texel[image.width]),
               colourOf(texel[image.width + 1])};
  } else {
    corners = {texelAt(image, column, row, wrap), texelAt(image, column + 1, row, wrap),
               texelAt(image, column, row + 1, wrap), texelAt(image, column + 1, row + 1, wrap)};
  }
  const Colour above = corners[0] * (1 - right) + corners[1] * right;
  const Colour below = corners[2] * (1 - right) + corners[3] * right;
  return above * (1 - lower) + below * lower;
}

}  // namespace

FilteredTexture::FilteredTexture(const Texture& texture, const std::vector<std::uint8_t>& shown)
    : texture_(&texture) {
  std::vector<std::vector<std::uint8_t>> weights;
  std::vector<std::uint8_t> last =
      shown.empty() ? std::vector<std::uint8_t>(texture.texels.size(), 255) : shown;
  while (level(smaller_.size()).width > 1 || level(smaller_.size()).height > 1) {
    smaller_.push_back(halved(level(smaller_.size()), last));
    weights.push_back(last);
  }
  for (std::size_t n = smaller_.size(); n-- > 1;)
    fillFrom(smaller_[n], weights[n - 1], smaller_[n - 1]);
}

double FilteredTexture::memoryBytes() const {
  double bytes = 0;
  for (const Texture& copy : smaller_)
    bytes += static_cast<double>(copy.texels.size() * sizeof(Texture::Texel));
  return bytes;
}

TextureFootprint FilteredTexture::footprint(const std::array<Vec2d, 3>& edges) const {
  const double width = texture_->width;
  const double height = texture_->height;
  double xx = 0;
  double xy = 0;
  double yy = 0;
  for (const Vec2d& edge : edges) {
    const double x = edge.x() * width;
    const double y = edge.y() * height;
    xx += x * x;
    xy += x * y;
    yy += y * y;
  }
  TextureFootprint made;
  if (!std::isfinite(xx + yy)) return made;
  // The axes of the ellipse with these moments. A side of the parallelogram along an axis has the
  // variance of three edges of a box that lie along it.
  const double middle = 0.5 * (xx + yy);
  const double half = std::sqrt(0.25 * (xx - yy) * (xx - yy) + xy * xy);
  Vec2d axis = xx >= yy ? Vec2d(0.5 * (xx - yy) + half, xy) : Vec2d(xy, 0.5 * (yy - xx) + half);
  axis = axis.lengthSqr() > 0 ? axis / std::sqrt(axis.lengthSqr()) : Vec2d(1, 0);
  double along = std::sqrt(middle + half);
  double across = std::sqrt(std::max(0.0, middle - half));
  double texel = 1;
  LevelLimits limits = limits_of_texture;
  while (made.level < smaller_.size() &&
         (across > limits.across * texel || along > limits.along * texel)) {
    ++made.level;
    texel *= 2;
    limits = limits_of_copies;
  }
  along = std::min(along, limits.along * texel);
  const auto samples = [&](double length) {
    // Two samples are exact on both sides of the middle of a texel, where the slope changes.
    const double least = length > 0.25 * texel ? 2 : 1;
    const double wanted = std::ceil(length / texel * limits.samples_per_texel);
    return static_cast<std::uint8_t>(std::clamp(wanted, least, 255.0));
  };
  made.samples = {samples(along), samples(std::min(across, along))};
  made.side = {Vec2f(static_cast<float>(axis.x() * along / width),
                     static_cast<float>(axis.y() * along / height)),
               Vec2f(static_cast<float>(-axis.y() * across / width),
                     static_cast<float>(axis.x() * across / height))};
  return made;
}

Vec4f FilteredTexture::sample(const Vec2f& at, const TextureFootprint& footprint,
                              const std::array<TextureWrap, 2>& wrap, bool is_smooth) const {
  const Texture& image = level(footprint.level);
  const bool is_interpolated = is_smooth || footprint.level > 0;
  Colour sum{};
  for (int i = 0; i < footprint.samples[0]; ++i) {
    const double along = (i + 0.5) / footprint.samples[0] - 0.5;
    for (int j = 0; j < footprint.samples[1]; ++j) {
      const double across = (j + 0.5) / footprint.samples[1] - 0.5;
      const double u = at.x() + footprint.side[0].x() * along + footprint.side[1].x() * across;
      const double v = at.y() + footprint.side[0].y() * along + footprint.side[1].y() * across;
      sum += is_interpolated
                 ? interpolated(image, u, v, wrap)
                 : texelAt(image, wholeOf(u * image.width), wholeOf(v * image.height), wrap);
    }
  }
  constexpr float whole = 65535;
  sum /= whole * static_cast<float>(footprint.samples[0] * footprint.samples[1]);
  return {sum[0], sum[1], sum[2], sum[3]};
}

}  // namespace vdbdither
