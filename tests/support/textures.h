#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "io/image/texture.h"
#include "vdbdither/model/appearance.h"

namespace vdbdither::test {

using Bytes = std::vector<std::uint8_t>;

/// Samples of an image, row by row from the top.
struct Samples {
  std::uint32_t width = 0;
  std::uint32_t height = 0;
  int channels = 3;
  int bits = 8;
  std::vector<std::uint16_t> values{};

  [[nodiscard]] double share(std::uint32_t x, std::uint32_t y, int channel) const;
  /// The bytes as a library takes them.
  [[nodiscard]] Bytes packed() const;
};

/// An image whose samples are all different from those around them, and not symmetrical.
Samples pattern(std::uint32_t width, std::uint32_t height, int channels, int bits = 8);

/// The chunks of a PNG that say what its colours mean.
struct PngColours {
  double gamma = 0;                        ///< gAMA, where it is not 0
  std::array<double, 8> chromaticities{};  ///< white, red, green, blue; where not 0
  bool is_srgb = false;
  Bytes icc_profile{};
};

/// A PNG of 1 to 4 channels.
Bytes pngOf(const Samples& samples, bool is_interlaced = false, const PngColours& colours = {});

/// A profile made by LittleCMS: for RGB with the primaries in the order green, blue, red, or for
/// grey.
Bytes swappedProfile(double gamma);
Bytes greyProfile(double gamma);
/// A profile of a table. RGB: of linear light in the order blue, red, green. CMYK: each ink takes
/// its share of the light, black of all three.
Bytes tableProfile(int channels);

/// The formula of IEC 61966-2-1.
double srgbToLinear(double encoded);

std::string textOf(const Bytes& bytes);

/// Decodes what messages call "texture 'a'".
Texture decoded(const Bytes& bytes, TextureOpacity opacity = TextureOpacity::keep);
/// Returns the message of the refusal, or "read".
std::string textureRefusal(const Bytes& bytes);

/// Expects linear colours, not multiplied by the opacity, that differ by `tolerance` at most.
using Colour = std::array<double, 4>;
void expectTexels(const Texture& texture, std::uint32_t width, std::uint32_t height,
                  const std::function<Colour(std::uint32_t x, std::uint32_t y)>& expected,
                  double tolerance = 1.01 / 65535);

/// Expects that every prefix is refused in one line that begins with the image's name, or, if
/// `may_end_early`, read.
void expectPrefixesAreRefused(const Bytes& bytes, bool may_end_early = false);
/// Expects that bytes are decoded to as many texels as they say, or refused in one line, whatever
/// is changed in them; always the same changes.
void expectSpoiltImagesAreReadOrRefused(const Bytes& bytes, int rounds = 400);

}  // namespace vdbdither::test
