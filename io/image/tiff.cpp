#include "io/image/tiff.h"

#include <algorithm>
#include <array>
#include <string>

#include "io/image/tiff_memory.h"
#include "io/image/tiff_rows.h"
#include "vdbdither/model/errors.h"

namespace vdbdither {

namespace {

/// A row of spans as the bytes of the file.
void packRow(std::span<const Span> spans, bool bits, std::vector<std::uint8_t>& row) {
  std::fill(row.begin(), row.end(), 0);
  std::uint32_t begin = 0;
  for (const Span& span : spans) {
    for (std::uint32_t x = begin; x < span.end; ++x) {
      if (!bits) {
        row[x] = static_cast<std::uint8_t>(span.value);
      } else if (span.value) {
        row[x / 8] |= static_cast<std::uint8_t>(128 >> x % 8);
      }
    }
    begin = span.end;
  }
}

void setPalette(TIFF* tiff, std::span<const std::uint32_t> palette) {
  std::array<std::array<std::uint16_t, 256>, 3> colours{};
  for (std::size_t i = 0; i < palette.size(); ++i) {
    for (std::size_t channel = 0; channel < 3; ++channel)
      colours[channel][i] = static_cast<std::uint16_t>((palette[i] >> 8 * channel & 255) * 257);
  }
  TIFFSetField(tiff, TIFFTAG_COLORMAP, colours[0].data(), colours[1].data(), colours[2].data());
}

}  // namespace

std::vector<std::uint8_t> encodeTiff(const SpanImage& image, const TiffFormat& format) {
  if (image.width == 0 || image.height == 0) throw DataError("an image without pixels is no TIFF");
  if (format.palette.size() > 256) throw DataError("a TIFF has at most 256 colours");
  const bool bits = format.palette.empty();
  constexpr double mm_per_cm = 10;
  TiffMemory memory;
  // Little-endian on every machine.
  TiffHandle tiff = openTiff(memory, "wl");
  if (!tiff) throw DataError("cannot make a TIFF: " + memory.error);
  TIFFSetField(tiff.get(), TIFFTAG_IMAGEWIDTH, image.width);
  TIFFSetField(tiff.get(), TIFFTAG_IMAGELENGTH, image.height);
  TIFFSetField(tiff.get(), TIFFTAG_SAMPLESPERPIXEL, 1);
  TIFFSetField(tiff.get(), TIFFTAG_BITSPERSAMPLE, bits ? 1 : 8);
  TIFFSetField(tiff.get(), TIFFTAG_COMPRESSION, bits ? COMPRESSION_CCITTFAX4 : COMPRESSION_LZW);
  TIFFSetField(tiff.get(), TIFFTAG_PHOTOMETRIC,
               bits ? PHOTOMETRIC_MINISBLACK : PHOTOMETRIC_PALETTE);
  TIFFSetField(tiff.get(), TIFFTAG_PLANARCONFIG, PLANARCONFIG_CONTIG);
  TIFFSetField(tiff.get(), TIFFTAG_RESOLUTIONUNIT, RESUNIT_CENTIMETER);
  TIFFSetField(tiff.get(), TIFFTAG_XRESOLUTION, mm_per_cm / format.pixel_width_mm);
  TIFFSetField(tiff.get(), TIFFTAG_YRESOLUTION, mm_per_cm / format.pixel_height_mm);
  TIFFSetField(tiff.get(), TIFFTAG_ROWSPERSTRIP, bits ? image.height : 64);
  if (!bits) setPalette(tiff.get(), format.palette);
  std::vector<std::uint8_t> row(bits ? (image.width + 7) / 8 : image.width);
  for (std::uint32_t y = 0; y < image.height; ++y) {
    packRow(image.row(y), bits, row);
    if (TIFFWriteScanline(tiff.get(), row.data(), y) != 1)
      throw DataError("cannot make a TIFF: " + memory.error);
  }
  tiff.reset();
  if (!memory.error.empty()) throw DataError("cannot make a TIFF: " + memory.error);
  return std::move(memory.written);
}

SpanImage decodeTiff(std::span<const std::uint8_t> bytes, const SizeCheck& check) {
  TiffMemory memory;
  memory.read = bytes;
  const TiffHandle tiff = openTiff(memory, "r");
  const auto refuse = [&] { return DataError("is not a readable TIFF: it is damaged"); };
  if (!tiff) throw refuse();
  const TiffHead head = tiffHeadOf(tiff.get());
  const std::uint32_t width = head.width;
  const std::uint32_t height = head.height;
  if (check) check(width, height);
  if (width == 0 || height == 0) throw refuse();
  if (!isPackedInAKnownWay(head))
    throw DataError("is a TIFF packed in a way that is not read; save it with LZW or deflate");
  if ((head.bits != 1 && head.bits != 8) || head.samples != 1 || TIFFIsTiled(tiff.get()))
    throw DataError("is a TIFF of another kind: one sample of 1 or 8 bits is wanted, in strips");
  const std::uint32_t flip = head.bits == 1 && head.meaning == PHOTOMETRIC_MINISWHITE ? 1 : 0;
  SpansBuilder spans(width);
  std::vector<std::uint8_t> row(static_cast<std::size_t>(TIFFScanlineSize(tiff.get())));
  for (std::uint32_t y = 0; y < height; ++y) {
    if (TIFFReadScanline(tiff.get(), row.data(), y) != 1) throw refuse();
    for (std::uint32_t x = 0; x < width; ++x)
      spans.pixel(x, head.bits == 8 ? row[x] : (row[x / 8] >> (7 - x % 8) & 1U) ^ flip);
    spans.endRow();
  }
  if (!memory.error.empty()) throw refuse();
  return spans.finish();
}

}  // namespace vdbdither
