// TIFF: TIFF revision 6.0 (Adobe, 1992), with the supplement for associated opacity.

#include <algorithm>
#include <array>
#include <cstring>
#include <vector>

#include "io/image/colour_image.h"
#include "io/image/png_spans.h"
#include "io/image/tiff.h"
#include "io/image/tiff_memory.h"
#include "io/image/tiff_rows.h"
#include "vdbdither/model/errors.h"

namespace vdbdither {

namespace {

bool isOfOneBit(const TiffHead& head) {
  return head.bits == 1 && head.samples == 1 &&
         (head.meaning == PHOTOMETRIC_MINISBLACK || head.meaning == PHOTOMETRIC_MINISWHITE);
}

bool isReadAsColours(const TiffHead& head) {
  if (head.number_type != SAMPLEFORMAT_UINT) return false;
  switch (head.meaning) {
    case PHOTOMETRIC_MINISBLACK:
    case PHOTOMETRIC_MINISWHITE:
      return head.bits == 8 || head.bits == 16;
    case PHOTOMETRIC_RGB:
      return head.samples >= 3 && (head.bits == 8 || head.bits == 16);
    case PHOTOMETRIC_PALETTE:
      return head.samples == 1 && head.bits == 8;
    default:
      return false;
  }
}

/// The colours of bits.
ColourImage blackAndWhite(SpanImage image) {
  for (Span& span : image.spans) span.value = span.value ? rgba(255, 255, 255) : rgba(0, 0, 0);
  return {.pixels = std::move(image), .is_grey = true, .has_opacity = false};
}

std::array<std::uint32_t, 256> paletteOf(TIFF* tiff) {
  std::array<std::uint16_t*, 3> channels{};
  if (TIFFGetField(tiff, TIFFTAG_COLORMAP, &channels[0], &channels[1], &channels[2]) == 0)
    throw DataError(damaged_tiff);
  std::array<std::uint32_t, 256> palette{};
  // Some programs store bytes where words belong.
  const bool are_bytes =
      std::all_of(channels.begin(), channels.end(), [](const std::uint16_t* one) {
        return std::all_of(one, one + 256, [](std::uint16_t value) { return value < 256; });
      });
  const auto byte = [&](std::size_t channel, std::size_t i) {
    return static_cast<std::uint8_t>(channels.at(channel)[i] >> (are_bytes ? 0 : 8));
  };
  for (std::size_t i = 0; i < palette.size(); ++i)
    palette.at(i) = rgba(byte(0, i), byte(1, i), byte(2, i));
  return palette;
}

/// The colour of a pixel from its samples.
class TiffPixels {
 public:
  TiffPixels(TIFF* tiff, const TiffHead& head)
      : head_(head),
        colours_(head.meaning == PHOTOMETRIC_RGB ? 3 : 1),
        opacity_(head.samples > colours_ ? head.opacity : SampleLayout::Opacity::none) {
    if (head.meaning == PHOTOMETRIC_PALETTE) palette_ = paletteOf(tiff);
  }

  [[nodiscard]] bool haveOpacity() const { return opacity_ != SampleLayout::Opacity::none; }

  [[nodiscard]] std::uint32_t colour(const std::uint8_t* row, std::size_t x) const {
    const std::size_t first = x * head_.samples;
    if (head_.meaning == PHOTOMETRIC_PALETTE) return palette_[row[first]];
    const std::uint8_t alpha = haveOpacity() ? upperByte(row, first + colours_) : std::uint8_t{255};
    const auto channel = [&](std::size_t i) {
      const std::uint8_t value = upperByte(row, first + i);
      if (opacity_ != SampleLayout::Opacity::associated || alpha == 0) return value;
      return static_cast<std::uint8_t>(std::min(255, (value * 255 + alpha / 2) / alpha));
    };
    if (colours_ == 3) return rgba(channel(0), channel(1), channel(2), alpha);
    const std::uint8_t grey =
        head_.meaning == PHOTOMETRIC_MINISWHITE ? ~channel(0) & 255 : channel(0);
    return rgba(grey, grey, grey, alpha);
  }

 private:
  [[nodiscard]] std::uint8_t upperByte(const std::uint8_t* row, std::size_t sample) const {
    if (head_.bits == 8) return row[sample];
    std::uint16_t word = 0;
    std::memcpy(&word, row + 2 * sample, sizeof word);
    return static_cast<std::uint8_t>(word >> 8);
  }

  const TiffHead& head_;
  std::size_t colours_;
  SampleLayout::Opacity opacity_;
  std::array<std::uint32_t, 256> palette_{};
};

}  // namespace

ColourImage decodeTiffImage(std::span<const std::uint8_t> bytes, const SizeCheck& check) {
  TiffMemory memory;
  memory.read = bytes;
  const TiffHandle tiff = openTiff(memory, "r");
  if (!tiff) throw DataError(damaged_tiff);
  if (TIFFLastDirectory(tiff.get()) == 0)
    throw DataError("is a TIFF of several pages; save each page as a file of its own");
  const TiffHead head = tiffHeadOf(tiff.get());
  if (check) check(head.width, head.height);
  constexpr int most_samples = 16;
  if (head.samples == 0 || head.samples > most_samples)
    throw DataError("is a TIFF of too many samples a pixel; save it as RGB");
  if (!isPackedInAKnownWay(head))
    throw DataError("is a TIFF packed in a way that is not read; save it with LZW or deflate");
  if (head.packing == COMPRESSION_JPEG)
    throw DataError("is a TIFF packed as JPEG, which changes pixels; save it with LZW or deflate");
  if (head.orientation != ORIENTATION_TOPLEFT)
    throw DataError("is a TIFF that does not begin at the top left; save it again without a turn");
  if (isOfOneBit(head) && TIFFIsTiled(tiff.get()) == 0)
    return blackAndWhite(decodeTiff(bytes, check));
  if (!isReadAsColours(head)) {
    throw DataError(
        "is a TIFF of a kind that is not read; save it as grey or RGB of 8 or 16 bits, or with a "
        "palette of 8 bits");
  }
  const TiffPixels pixels(tiff.get(), head);
  TiffRows rows(tiff.get(), head);
  SpansBuilder spans(head.width);
  for (std::uint32_t y = 0; y < head.height; ++y) {
    const std::uint8_t* row = rows.row(y);
    for (std::uint32_t x = 0; x < head.width; ++x) spans.pixel(x, pixels.colour(row, x));
    spans.endRow();
  }
  return {.pixels = spans.finish(),
          .is_grey = head.meaning != PHOTOMETRIC_RGB && head.meaning != PHOTOMETRIC_PALETTE,
          .has_opacity = pixels.haveOpacity()};
}

}  // namespace vdbdither
