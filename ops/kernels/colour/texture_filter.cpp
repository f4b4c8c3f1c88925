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

/// Four texels that are neighbours, and what lies between them.
struct Cell {
  Colour upper_left, upper_right, lower_left, lower_right;

  /// @param right  from the middle of the left texels to that of the right ones, 0 … 1
  /// @param lower  from the middle of the upper texels to that of the lower ones
  [[nodiscard]] Colour at(float right, float lower) const {
    const Colour above = upper_left * (1 - right) + upper_right * right;
    const Colour below = lower_left * (1 - right) + lower_right * right;
    return above * (1 - lower) + below * lower;
  }
  /// How much the colour differs from one that is linear, for each unit of right · lower.
  [[nodiscard]] Colour twist() const { return upper_left - upper_right - lower_left + lower_right; }
};

/// The cell whose upper left texel is at a place. All four lie in the image.
Cell cellWithin(const Texture& image, std::int32_t column, std::int32_t row) {
  const Texture::Texel* texel = image.texels.data() + static_cast<std::size_t>(row) * image.width +
                                static_cast<std::size_t>(column);
  return {colourOf(texel[0]), colourOf(texel[1]), colourOf(texel[image.width]),
          colourOf(texel[image.width + 1])};
}

/// Interpolates at x, y in texels from the middle of the first one. All texels lie in the image.
Colour interpolatedWithin(const Texture& image, double x, double y) {
  const auto column = static_cast<std::int32_t>(x);
  const auto row = static_cast<std::int32_t>(y);
  return cellWithin(image, column, row)
      .at(static_cast<float>(x - column), static_cast<float>(y - row));
}

/// The same anywhere.
Colour interpolated(const Texture& image, double x, double y,
                    const std::array<TextureWrap, 2>& wrap) {
  const std::int64_t column = wholeOf(x);
  const std::int64_t row = wholeOf(y);
  const Cell cell{texelAt(image, column, row, wrap), texelAt(image, column + 1, row, wrap),
                  texelAt(image, column, row + 1, wrap), texelAt(image, column + 1, row + 1, wrap)};
  return cell.at(static_cast<float>(x - static_cast<double>(column)),
                 static_cast<float>(y - static_cast<double>(row)));
}

/// The mean of the samples of a footprint around a point, in texels from the middle of the first.
template <class ColourAt>
Colour meanOf(const TextureFootprint& footprint, const Vec2d& middle, const ColourAt& colour_at) {
  const auto [along, across] = footprint.samples;
  const auto& [step, side_step] = footprint.step;
  const Vec2d first = middle - 0.5 * Vec2d(step * static_cast<float>(along - 1) +
                                           side_step * static_cast<float>(across - 1));
  Colour sum{};
  for (int i = 0; i < along; ++i)
    for (int j = 0; j < across; ++j)
      sum += colour_at(first.x() + i * double{step.x()} + j * double{side_step.x()},
                       first.y() + i * double{step.y()} + j * double{side_step.y()});
  return sum / static_cast<float>(along * across);
}

/// The same of samples from `low` to `high`, all within the image.
Colour meanWithin(const Texture& image, const TextureFootprint& footprint, const Vec2d& middle,
                  const Vec2d& low, const Vec2d& high) {
  const auto column = static_cast<std::int32_t>(low.x());
  const auto row = static_cast<std::int32_t>(low.y());
  if (static_cast<std::int32_t>(high.x()) != column || static_cast<std::int32_t>(high.y()) != row)
    return meanOf(footprint, middle,
                  [&](double x, double y) { return interpolatedWithin(image, x, y); });
  // In one cell the mean is known from the middle.
  const Cell cell = cellWithin(image, column, row);
  return cell.at(static_cast<float>(middle.x() - column), static_cast<float>(middle.y() - row)) +
         cell.twist() * footprint.covariance;
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
  const Vec2d scale(level(made.level).width / width, level(made.level).height / height);
  const auto step = [&](const Vec2d& side, std::size_t n) {
    return Vec2f(side * scale / static_cast<double>(made.samples[n]));
  };
  made.step = {step(axis * along, 0), step(Vec2d(-axis.y(), axis.x()) * across, 1)};
  for (std::size_t n = 0; n < 2; ++n) {
    const auto count = static_cast<float>(made.samples[n]);
    const Vec2f& one = made.step[n];
    made.reach += 0.5F * (count - 1) * Vec2f(std::abs(one.x()), std::abs(one.y()));
    // The variance of numbers with equal steps of 1.
    made.covariance += (count * count - 1) / 12 * one.x() * one.y();
  }
  return made;
}

Vec4f FilteredTexture::sample(const Vec2f& at, const TextureFootprint& footprint,
                              const std::array<TextureWrap, 2>& wrap, bool is_smooth) const {
  const Texture& image = level(footprint.level);
  const Vec2d middle(double{at.x()} * image.width - 0.5, double{at.y()} * image.height - 0.5);
  const Vec2d low = middle - Vec2d(footprint.reach);
  const Vec2d high = middle + Vec2d(footprint.reach);
  constexpr double rounding = 0.01;
  const bool is_within = low.x() >= rounding && low.y() >= rounding &&
                         high.x() + rounding < image.width - 1.0 &&
                         high.y() + rounding < image.height - 1.0;
  Colour mean;
  if (!is_smooth && footprint.level == 0) {
    mean = meanOf(footprint, middle, [&](double x, double y) {
      return texelAt(image, wholeOf(x + 0.5), wholeOf(y + 0.5), wrap);
    });
  } else if (is_within) {
    mean = meanWithin(image, footprint, middle, low, high);
  } else {
    mean = meanOf(footprint, middle,
                  [&](double x, double y) { return interpolated(image, x, y, wrap); });
  }
  constexpr float whole = 65535;
  mean /= whole;
  return {mean[0], mean[1], mean[2], mean[3]};
}

}  // namespace vdbdither
