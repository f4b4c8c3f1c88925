#include "io/image/texture_builder.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <type_traits>

#include "io/image/srgb.h"
#include "vdbdither/model/errors.h"
#include "vdbdither/model/interrupt.h"

namespace vdbdither {

namespace {

constexpr double most_share = 65535;

double clipped(double value) {
  if (!(value > 0)) return 0;
  return value < 1 ? value : 1;
}

std::uint16_t shareOf(double value) { return static_cast<std::uint16_t>(value * most_share + 0.5); }

/// A sample as a share of its maximum; reals as they are.
template <class Sample>
double valueOf(Sample sample) {
  if constexpr (std::is_floating_point_v<Sample>) {
    return sample;
  } else {
    return sample / static_cast<double>(std::numeric_limits<Sample>::max());
  }
}

/// The same without associated opacity.
template <class Sample>
double straightValueOf(Sample sample, double opacity) {
  const double value = clipped(valueOf(sample));
  return opacity > 0 ? clipped(value / opacity) : value;
}

/// Linear light by sample, for this many samples.
std::vector<double> curveOf(const ColourSpace& space, std::size_t count) {
  std::vector<double> curve(count);
  for (std::size_t i = 0; i < count; ++i) {
    const double encoded = static_cast<double>(i) / static_cast<double>(count - 1);
    curve[i] = space.exponent ? std::pow(encoded, *space.exponent) : linearOfSrgb(encoded);
  }
  return curve;
}

}  // namespace

TextureBuilder::TextureBuilder(std::uint32_t width, std::uint32_t height,
                               const SampleLayout& layout, const ColourSpace& space,
                               TextureOpacity opacity)
    : layout_(layout),
      opacity_(opacity),
      transform_(ColourTransform::make(space, layout.colours)),
      texture_{width, height, {}} {
  texture_.texels.reserve(std::size_t{width} * height);
  const bool is_divided =
      layout.opacity == SampleLayout::Opacity::associated || layout.colours == 4;
  if (transform_ != nullptr) {
    encoded_.resize(std::size_t{width} * static_cast<std::size_t>(transform_->channels()));
    transformed_.resize(std::size_t{width} * 3);
  } else if (layout.type == SampleLayout::Type::real) {
    return;
  } else if (is_divided || layout.type == SampleLayout::Type::word) {
    curve_ = curveOf(space, 65536);
  } else {
    curve_ = curveOf(space, 256);
  }
}

void TextureBuilder::row(const std::uint8_t* samples) {
  throwIfInterrupted();
  switch (layout_.type) {
    case SampleLayout::Type::byte:
      return convert(samples);
    case SampleLayout::Type::word:
      return convert(reinterpret_cast<const std::uint16_t*>(samples));
    case SampleLayout::Type::real:
      return convert(reinterpret_cast<const float*>(samples));
  }
}

double TextureBuilder::curveAt(double encoded) const {
  if (curve_.empty()) return encoded;
  return curve_[static_cast<std::size_t>(encoded * static_cast<double>(curve_.size() - 1) + 0.5)];
}

template <class Sample>
void TextureBuilder::decodeByCurve(const Sample* pixel, double opacity, double* linear) const {
  if (layout_.colours == 4) {
    const double light = 1 - clipped(valueOf(pixel[3]));
    for (int i = 0; i < 3; ++i) linear[i] = curveAt((1 - clipped(valueOf(pixel[i]))) * light);
    return;
  }
  for (int i = 0; i < layout_.colours; ++i) {
    if constexpr (std::is_integral_v<Sample>) {
      if (curve_.size() == std::size_t{std::numeric_limits<Sample>::max()} + 1 &&
          layout_.opacity != SampleLayout::Opacity::associated) {
        linear[i] = curve_[pixel[i]];
        continue;
      }
    }
    linear[i] = curveAt(layout_.opacity == SampleLayout::Opacity::associated
                            ? straightValueOf(pixel[i], opacity)
                            : clipped(valueOf(pixel[i])));
  }
  if (layout_.colours == 1) linear[1] = linear[2] = linear[0];
}

template <class Sample>
void TextureBuilder::encodeForTransform(const Sample* pixel, double opacity, float* encoded) const {
  for (int i = 0; i < transform_->channels(); ++i) {
    const Sample sample = pixel[layout_.colours == 1 ? 0 : i];
    const double value = layout_.opacity == SampleLayout::Opacity::associated
                             ? straightValueOf(sample, opacity)
                             : clipped(valueOf(sample));
    encoded[i] = static_cast<float>(layout_.colours == 4 ? 100 * value : value);
  }
}

template <class Sample>
void TextureBuilder::convert(const Sample* samples) {
  const std::size_t stride = layout_.samples();
  const auto opacityOf = [&](const Sample* pixel) {
    return layout_.opacity == SampleLayout::Opacity::none
               ? 1.0
               : clipped(valueOf(pixel[layout_.colours]));
  };
  if (transform_ != nullptr) {
    const auto channels = static_cast<std::size_t>(transform_->channels());
    for (std::size_t x = 0; x < texture_.width; ++x) {
      const Sample* pixel = samples + x * stride;
      encodeForTransform(pixel, opacityOf(pixel), &encoded_[x * channels]);
    }
    transform_->run(encoded_.data(), transformed_.data(), texture_.width);
  }
  for (std::size_t x = 0; x < texture_.width; ++x) {
    const Sample* pixel = samples + x * stride;
    const double own_opacity = opacityOf(pixel);
    std::array<double, 3> linear{};
    if (transform_ != nullptr) {
      for (std::size_t i = 0; i < 3; ++i) linear[i] = clipped(transformed_[3 * x + i]);
    } else {
      decodeByCurve(pixel, own_opacity, linear.data());
    }
    const double opacity = opacity_ == TextureOpacity::ignore ? 1 : own_opacity;
    texture_.texels.push_back({shareOf(linear[0] * opacity), shareOf(linear[1] * opacity),
                               shareOf(linear[2] * opacity), shareOf(opacity)});
  }
}

void checkTextureSize(std::uint64_t width, std::uint64_t height, std::size_t file_bytes) {
  if (width == 0 || height == 0) throw DataError("has no pixels; save it again");
  const std::string size = std::to_string(width) + " x " + std::to_string(height) + " pixels";
  if (width > most_texels / height) {
    throw DataError("has " + size + "; at most " + std::to_string(most_texels) +
                    " are read; scale it down");
  }
  // Up to here it takes some hundred MB at most, whatever the file holds.
  constexpr std::uint64_t cheap_texels = std::uint64_t{1} << 24;
  constexpr std::uint64_t most_texels_per_byte = 64;
  const std::uint64_t texels = width * height;
  if (texels > cheap_texels && texels / most_texels_per_byte > file_bytes) {
    throw DataError("has " + size + " in " + std::to_string(file_bytes) +
                    " bytes, too few for a picture; scale it down");
  }
}

}  // namespace vdbdither
