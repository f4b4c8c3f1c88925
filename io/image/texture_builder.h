#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "io/image/colour_space.h"
#include "io/image/texture.h"
#include "vdbdither/model/appearance.h"

namespace vdbdither {

/// The samples of a row of pixels as a decoder gives them.
struct SampleLayout {
  enum class Type { byte, word, real };
  enum class Opacity { none, straight, associated };  ///< associated: colours are multiplied by it

  int colours = 3;  ///< samples of colour in a pixel: 1 grey, 3 RGB, 4 CMYK (amounts of ink)
  Opacity opacity = Opacity::none;  ///< one sample after the colours, unless it is `none`
  Type type = Type::byte;           ///< word: 16 bits of this machine; real: float
  int skipped = 0;                  ///< samples after these that mean nothing here

  [[nodiscard]] std::size_t samples() const {
    return static_cast<std::size_t>(colours + (opacity == Opacity::none ? 0 : 1) + skipped);
  }
  [[nodiscard]] std::size_t bytesPerPixel() const {
    return samples() * (type == Type::byte ? 1 : type == Type::word ? 2 : 4);
  }
};

/// Makes a texture of rows from the top. Memory is taken as rows come. Reals are linear light
/// unless the colour space says more; NaN counts as 0.
class TextureBuilder {
 public:
  TextureBuilder(std::uint32_t width, std::uint32_t height, const SampleLayout& layout,
                 const ColourSpace& space, TextureOpacity opacity);
  TextureBuilder(const TextureBuilder&) = delete;
  TextureBuilder& operator=(const TextureBuilder&) = delete;
  ~TextureBuilder() = default;

  /// @param samples  `width` pixels, aligned for their type. Throws Interrupted.
  void row(const std::uint8_t* samples);

  [[nodiscard]] Texture take() { return std::move(texture_); }

 private:
  using Light = std::array<double, 3>;

  template <class Sample>
  void convert(const Sample* samples, Texture::Texel* texels) const;
  template <class Sample>
  [[nodiscard]] Light lightOf(const Sample* pixel, double opacity) const;
  [[nodiscard]] double curveAt(double encoded) const;

  SampleLayout layout_;
  TextureOpacity opacity_;
  std::unique_ptr<ColourTransform> transform_;
  std::vector<double> own_curve_;
  std::span<const double> curve_;            ///< linear light by sample; empty for reals
  std::vector<std::uint16_t> opaque_curve_;  ///< the same of bytes, as opaque texels hold it
  Texture texture_;
};

/// Throws DataError, in words that go on from the image's name, for a size without pixels, above
/// `most_texels`, or far beyond what so many bytes hold of a picture: an image of one colour can be
/// packed to nearly nothing.
/// @param pixel_bytes  of a pixel in the file before it was packed
void checkTextureSize(std::uint64_t width, std::uint64_t height, std::uint64_t pixel_bytes,
                      std::size_t file_bytes);

/// The decoders of decodeTexture. They throw DataError in words that go on from the image's name.
Texture decodePngTexture(std::span<const std::uint8_t> bytes, TextureOpacity opacity);
Texture decodeJpegTexture(std::span<const std::uint8_t> bytes, TextureOpacity opacity);
Texture decodeWebpTexture(std::span<const std::uint8_t> bytes, TextureOpacity opacity);
Texture decodeTiffTexture(std::span<const std::uint8_t> bytes, TextureOpacity opacity);
Texture decodeExrTexture(std::span<const std::uint8_t> bytes, TextureOpacity opacity);

}  // namespace vdbdither
