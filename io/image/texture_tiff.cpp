// TIFF: TIFF revision 6.0 (Adobe, 1992), with the supplements for associated opacity and for
// floats.

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <half.h>
#include <string>
#include <vector>

#include "io/image/texture_builder.h"
#include "io/image/tiff_memory.h"
#include "io/image/tiff_rows.h"
#include "vdbdither/model/errors.h"

namespace vdbdither {

namespace {

using Bytes = std::span<const std::uint8_t>;

/// Whether the samples are taken as they are, rather than through libtiff's conversion to RGBA of
/// 8 bits.
bool isPlain(const TiffHead& head) {
  const bool is_grey =
      head.meaning == PHOTOMETRIC_MINISBLACK || head.meaning == PHOTOMETRIC_MINISWHITE;
  const bool is_rgb = head.meaning == PHOTOMETRIC_RGB && head.samples >= 3;
  const bool is_real =
      head.number_type == SAMPLEFORMAT_IEEEFP && (head.bits == 16 || head.bits == 32);
  const bool is_whole =
      head.number_type != SAMPLEFORMAT_IEEEFP && (head.bits == 8 || head.bits == 16);
  return (is_grey || is_rgb) && (is_real || is_whole);
}

SampleLayout layoutOf(const TiffHead& head) {
  SampleLayout layout;
  layout.colours = head.meaning == PHOTOMETRIC_RGB ? 3 : 1;
  layout.opacity = head.opacity;
  if (head.samples <= layout.colours) layout.opacity = SampleLayout::Opacity::none;
  layout.skipped = head.samples - static_cast<int>(layout.samples());
  if (head.number_type == SAMPLEFORMAT_IEEEFP) {
    layout.type = SampleLayout::Type::real;
  } else if (head.bits == 16) {
    layout.type = SampleLayout::Type::word;
  }
  return layout;
}

ColourSpace tiffColourSpace(TIFF* tiff) {
  ColourSpace space;
  std::uint32_t size = 0;
  const std::uint8_t* profile = nullptr;
  if (TIFFGetField(tiff, TIFFTAG_ICCPROFILE, &size, &profile) != 0 && size > 0)
    space.icc_profile.assign(profile, profile + size);
  return space;
}

/// Turns halves into floats, and white-is-zero into black-is-zero, as the builder takes them.
class TiffSamples {
 public:
  TiffSamples(const TiffHead& head, const SampleLayout& layout) : head_(head), layout_(layout) {
    row_.resize(head.width * layout.bytesPerPixel());
  }

  const std::uint8_t* prepare(const std::uint8_t* row) {
    const std::size_t count = std::size_t{head_.width} * head_.samples;
    if (layout_.type == SampleLayout::Type::real && head_.bits == 16) {
      for (std::size_t i = 0; i < count; ++i) {
        std::uint16_t bits = 0;
        std::memcpy(&bits, row + 2 * i, sizeof bits);
        half value;
        value.setBits(bits);
        const float real = value;
        std::memcpy(row_.data() + 4 * i, &real, sizeof real);
      }
    } else {
      std::memcpy(row_.data(), row, row_.size());
    }
    if (head_.meaning == PHOTOMETRIC_MINISWHITE) invert();
    return row_.data();
  }

 private:
  void invert() {
    const std::size_t step = head_.samples;
    for (std::size_t i = 0; i < head_.width * step; i += step) {
      if (layout_.type == SampleLayout::Type::byte) {
        row_[i] = static_cast<std::uint8_t>(255 - row_[i]);
      } else if (layout_.type == SampleLayout::Type::word) {
        auto* words = reinterpret_cast<std::uint16_t*>(row_.data());
        words[i] = static_cast<std::uint16_t>(65535 - words[i]);
      } else {
        auto* reals = reinterpret_cast<float*>(row_.data());
        reals[i] = 1 - reals[i];
      }
    }
  }

  const TiffHead& head_;
  const SampleLayout& layout_;
  std::vector<std::uint8_t> row_;
};

/// Whether each strip or tile has bytes. Where they are missing, libtiff converts zeros: a file of
/// a few bytes would become an image of any size.
bool hasAllBlocks(TIFF* tiff) {
  const std::uint32_t count =
      TIFFIsTiled(tiff) ? TIFFNumberOfTiles(tiff) : TIFFNumberOfStrips(tiff);
  for (std::uint32_t block = 0; block < count; ++block)
    if (TIFFGetStrileByteCount(tiff, block) == 0) return false;
  return true;
}

/// Other kinds of pixels, as libtiff converts them: palettes, few bits, YCbCr, CMYK, Lab.
Texture readConverted(TIFF* tiff, const TiffHead& head, TextureOpacity opacity) {
  constexpr std::uint64_t most_converted = std::uint64_t{1} << 26;
  if (std::uint64_t{head.width} * head.height > most_converted)
    throw DataError("is a TIFF of a rare kind and too large for it; save it as RGB");
  std::array<char, 1024> why{};
  if (TIFFRGBAImageOK(tiff, why.data()) == 0)
    throw DataError("is a TIFF of a kind that is not read; save it as RGB of 8 or 16 bits");
  if (!hasAllBlocks(tiff)) throw DataError(damaged_tiff);
  std::vector<std::uint32_t> raster(std::size_t{head.width} * head.height);
  if (TIFFReadRGBAImageOriented(tiff, head.width, head.height, raster.data(), head.orientation,
                                1) != 1)
    throw DataError(damaged_tiff);
  SampleLayout layout;
  layout.opacity = SampleLayout::Opacity::associated;
  const ColourSpace space =
      head.meaning == PHOTOMETRIC_SEPARATED ? ColourSpace{} : tiffColourSpace(tiff);
  TextureBuilder builder(head.width, head.height, layout, space, opacity);
  std::vector<std::uint8_t> row(std::size_t{head.width} * 4);
  for (std::uint32_t y = 0; y < head.height; ++y) {
    for (std::size_t x = 0; x < head.width; ++x) {
      const std::uint32_t pixel = raster[std::size_t{y} * head.width + x];
      row[4 * x] = static_cast<std::uint8_t>(TIFFGetR(pixel));
      row[4 * x + 1] = static_cast<std::uint8_t>(TIFFGetG(pixel));
      row[4 * x + 2] = static_cast<std::uint8_t>(TIFFGetB(pixel));
      row[4 * x + 3] = static_cast<std::uint8_t>(TIFFGetA(pixel));
    }
    builder.row(row.data());
  }
  return builder.take();
}

/// The image as it is meant to be seen: the tag says where its first row and column belong.
Texture oriented(Texture texture, std::uint16_t orientation) {
  if (orientation <= ORIENTATION_TOPLEFT || orientation > ORIENTATION_LEFTBOT) return texture;
  const bool is_turned = orientation >= ORIENTATION_LEFTTOP;
  const bool from_right =
      orientation == ORIENTATION_TOPRIGHT || orientation == ORIENTATION_BOTRIGHT ||
      orientation == ORIENTATION_RIGHTTOP || orientation == ORIENTATION_RIGHTBOT;
  const bool from_bottom =
      orientation == ORIENTATION_BOTRIGHT || orientation == ORIENTATION_BOTLEFT ||
      orientation == ORIENTATION_RIGHTBOT || orientation == ORIENTATION_LEFTBOT;
  Texture result{texture.width, texture.height, {}};
  if (is_turned) std::swap(result.width, result.height);
  result.texels.reserve(texture.texels.size());
  for (std::uint32_t y = 0; y < result.height; ++y) {
    for (std::uint32_t x = 0; x < result.width; ++x) {
      const std::uint32_t seen_x = from_right ? result.width - 1 - x : x;
      const std::uint32_t seen_y = from_bottom ? result.height - 1 - y : y;
      const std::uint32_t column = is_turned ? seen_y : seen_x;
      const std::uint32_t row = is_turned ? seen_x : seen_y;
      result.texels.push_back(texture.texels[std::size_t{row} * texture.width + column]);
    }
  }
  return result;
}

}  // namespace

Texture decodeTiffTexture(Bytes bytes, TextureOpacity opacity) {
  TiffMemory memory;
  memory.read = bytes;
  const TiffHandle tiff = openTiff(memory, "r");
  if (tiff == nullptr) throw DataError(damaged_tiff);
  const TiffHead head = tiffHeadOf(tiff.get());
  checkTextureSize(head.width, head.height, (head.samples * std::uint64_t{head.bits} + 7) / 8,
                   bytes.size());
  constexpr int most_samples = 16;
  if (head.samples == 0 || head.samples > most_samples)
    throw DataError("is a TIFF of too many samples a pixel; save it as RGB");
  if (!isPackedInAKnownWay(head))
    throw DataError("is a TIFF packed in a way that is not read; save it with LZW or deflate");
  if (!isPlain(head)) return oriented(readConverted(tiff.get(), head, opacity), head.orientation);

  const SampleLayout layout = layoutOf(head);
  TextureBuilder builder(head.width, head.height, layout, tiffColourSpace(tiff.get()), opacity);
  TiffRows rows(tiff.get(), head);
  TiffSamples samples(head, layout);
  for (std::uint32_t y = 0; y < head.height; ++y) builder.row(samples.prepare(rows.row(y)));
  return oriented(builder.take(), head.orientation);
}

}  // namespace vdbdither
