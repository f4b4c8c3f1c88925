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

/// To the nearest; of two, up.
std::uint16_t shareOf(double value) {
  const double shifted = value * most_share + 0.5;
  return static_cast<std::uint16_t>(shifted);
}

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
std::vector<double> curveOf(const std::optional<double>& exponent, std::size_t count) {
  std::vector<double> curve(count);
  for (std::size_t i = 0; i < count; ++i) {
    const double encoded = static_cast<double>(i) / static_cast<double>(count - 1);
    curve[i] = exponent ? std::pow(encoded, *exponent) : linearOfSrgb(encoded);
  }
  return curve;
}

constexpr std::size_t fine_steps = 65536;

/// That of sRGB is made once.
const std::vector<double>& fineSrgbCurve() {
  static const std::vector<double> curve = curveOf(std::nullopt, fine_steps);
  return curve;
}

/// Up to some texels, they take some hundred MB at most and little time, whatever the file holds.
bool areTooFewBytes(std::uint64_t texels, std::uint64_t file_bytes) {
  constexpr std::uint64_t cheap_texels = std::uint64_t{1} << 24;
  constexpr std::uint64_t most_texels_per_byte = 64;
  return texels > cheap_texels && texels / most_texels_per_byte > file_bytes;
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
  if (transform_ != nullptr || layout.type == SampleLayout::Type::real) return;
  const bool has_other_values = layout.type == SampleLayout::Type::word || layout.colours == 4 ||
                                layout.opacity == SampleLayout::Opacity::associated;
  if (has_other_values && !space.exponent) {
    curve_ = fineSrgbCurve();
  } else {
    own_curve_ = curveOf(space.exponent, has_other_values ? fine_steps : 256);
    curve_ = own_curve_;
  }
  for (std::size_t i = 0; !has_other_values && i < 256; ++i)
    opaque_curve_.push_back(shareOf(curve_[i]));
}

void TextureBuilder::row(const std::uint8_t* samples) {
  throwIfInterrupted();
  const std::size_t begin = texture_.texels.size();
  texture_.texels.resize(begin + texture_.width);
  Texture::Texel* texels = texture_.texels.data() + begin;
  switch (layout_.type) {
    case SampleLayout::Type::byte:
      return convert(samples, texels);
    case SampleLayout::Type::word:
      return convert(reinterpret_cast<const std::uint16_t*>(samples), texels);
    case SampleLayout::Type::real:
      return convert(reinterpret_cast<const float*>(samples), texels);
  }
}

double TextureBuilder::curveAt(double encoded) const {
  if (curve_.empty()) return encoded;
  const double shifted = encoded * static_cast<double>(curve_.size() - 1) + 0.5;
  return curve_[static_cast<std::size_t>(shifted)];
}

template <class Sample>
TextureBuilder::Light TextureBuilder::lightOf(const Sample* pixel, double opacity) const {
  std::array<double, 4> values{};
  for (int i = 0; i < layout_.colours; ++i) {
    values[static_cast<std::size_t>(i)] = layout_.opacity == SampleLayout::Opacity::associated
                                              ? straightValueOf(pixel[i], opacity)
                                              : clipped(valueOf(pixel[i]));
  }
  if (layout_.colours == 1) values[1] = values[2] = values[0];
  if (transform_ != nullptr) {
    const ColourTransform::Linear linear = transform_->at(values.data());
    return {clipped(linear[0]), clipped(linear[1]), clipped(linear[2])};
  }
  if (layout_.colours == 1) {
    const double light = curveAt(values[0]);
    return {light, light, light};
  }
  if (layout_.colours == 4) {
    for (std::size_t i = 0; i < 3; ++i) values[i] = (1 - values[i]) * (1 - values[3]);
  }
  return {curveAt(values[0]), curveAt(values[1]), curveAt(values[2])};
}

template <class Sample>
void TextureBuilder::convert(const Sample* samples, Texture::Texel* texels) const {
  const std::size_t stride = layout_.samples();
  const bool has_opacity = layout_.opacity != SampleLayout::Opacity::none;
  const std::size_t green = layout_.colours == 1 ? 0 : 1;
  for (std::size_t x = 0; x < texture_.width; ++x) {
    const Sample* pixel = samples + x * stride;
    const double own_opacity = has_opacity ? clipped(valueOf(pixel[layout_.colours])) : 1;
    const double opacity = opacity_ == TextureOpacity::ignore ? 1 : own_opacity;
    if constexpr (std::is_same_v<Sample, std::uint8_t>) {
      if (opacity == 1 && !opaque_curve_.empty()) {
        texels[x] = {opaque_curve_[pixel[0]], opaque_curve_[pixel[green]],
                     opaque_curve_[pixel[2 * green]], 65535};
        continue;
      }
    }
    const Light light = lightOf(pixel, own_opacity);
    texels[x] = {shareOf(light[0] * opacity), shareOf(light[1] * opacity),
                 shareOf(light[2] * opacity), shareOf(opacity)};
  }
}

void checkTexturesTogether(std::uint64_t texels, std::uint64_t file_bytes) {
  if (texels > most_texels) {
    throw DataError("have more than " + std::to_string(most_texels) +
                    " pixels together; scale them down");
  }
  if (areTooFewBytes(texels, file_bytes)) {
    throw DataError("have " + std::to_string(texels) + " pixels in " + std::to_string(file_bytes) +
                    " bytes, too few for pictures; scale them down");
  }
}

void checkTextureSize(std::uint64_t width, std::uint64_t height, std::uint64_t pixel_bytes,
                      std::size_t file_bytes) {
  if (width == 0 || height == 0) throw DataError("has no pixels; save it again");
  const std::string size = std::to_string(width) + " x " + std::to_string(height) + " pixels";
  if (width > most_texels / height) {
    throw DataError("has " + size + "; at most " + std::to_string(most_texels) +
                    " are read; scale it down");
  }
  constexpr std::uint64_t cheap_bytes = std::uint64_t{1} << 28;
  constexpr std::uint64_t most_bytes_per_byte = 256;
  const std::uint64_t texels = width * height;
  const std::uint64_t bytes = texels * pixel_bytes;
  if (areTooFewBytes(texels, file_bytes) ||
      (bytes > cheap_bytes && bytes / most_bytes_per_byte > file_bytes)) {
    throw DataError("has " + size + " in " + std::to_string(file_bytes) +
                    " bytes, too few for a picture; scale it down");
  }
}

}  // namespace vdbdither
