// The bitmap of Windows with a BITMAPINFOHEADER, as Microsoft documents it: rows from the bottom
// up, each of whole 32-bit words.

#include "io/image/bmp.h"

#include <array>
#include <cmath>
#include <cstddef>
#include <string>

#include "io/file/little_endian.h"
#include "vdbdither/model/errors.h"

namespace vdbdither {

namespace {

constexpr std::size_t file_header_bytes = 14;
constexpr std::size_t info_header_bytes = 40;
constexpr std::size_t pixels_at = file_header_bytes + info_header_bytes + 8;
constexpr double metre_mm = 1000;

std::size_t rowBytes(std::uint32_t width) { return (std::size_t{width} + 31) / 32 * 4; }

std::uint32_t numberAt(std::span<const std::uint8_t> bytes, std::size_t at, int size) {
  return static_cast<std::uint32_t>(littleEndian(bytes.subspan(at), size));
}

std::uint32_t perMetre(double pixel_mm) {
  return pixel_mm > 0 ? static_cast<std::uint32_t>(std::lround(metre_mm / pixel_mm)) : 0;
}

}  // namespace

std::vector<std::uint8_t> encodeBmp(const SpanImage& image, double pixel_width_mm,
                                    double pixel_height_mm) {
  const std::size_t row_bytes = rowBytes(image.width);
  const std::size_t size = pixels_at + row_bytes * image.height;
  std::vector<std::uint8_t> bytes;
  bytes.reserve(size);
  putLittleEndian(bytes, 'B' | 'M' << 8, 2);
  putLittleEndian(bytes, size, 4);
  putLittleEndian(bytes, 0, 4);
  putLittleEndian(bytes, pixels_at, 4);
  putLittleEndian(bytes, info_header_bytes, 4);
  putLittleEndian(bytes, image.width, 4);
  putLittleEndian(bytes, image.height, 4);
  putLittleEndian(bytes, 1, 2);  // planes
  putLittleEndian(bytes, 1, 2);  // bits a pixel
  putLittleEndian(bytes, 0, 4);  // uncompressed
  putLittleEndian(bytes, row_bytes * image.height, 4);
  putLittleEndian(bytes, perMetre(pixel_width_mm), 4);
  putLittleEndian(bytes, perMetre(pixel_height_mm), 4);
  putLittleEndian(bytes, 2, 4);  // colours
  putLittleEndian(bytes, 2, 4);
  putLittleEndian(bytes, 0x000000, 4);
  putLittleEndian(bytes, 0xffffff, 4);
  bytes.resize(size);
  for (std::uint32_t y = 0; y < image.height; ++y) {
    std::uint8_t* row = bytes.data() + pixels_at + row_bytes * (image.height - 1 - y);
    std::uint32_t x = 0;
    for (const Span& span : image.row(y)) {
      if (span.value == 0) x = span.end;
      while (x < span.end) {
        const bool is_whole_byte = x % 8 == 0 && span.end - x >= 8;
        row[x / 8] |= is_whole_byte ? 0xff : 0x80 >> x % 8;
        x += is_whole_byte ? 8 : 1;
      }
    }
  }
  return bytes;
}

SpanImage decodeBmp(std::span<const std::uint8_t> bytes, const SizeCheck& check) {
  if (bytes.size() < pixels_at || bytes[0] != 'B' || bytes[1] != 'M')
    throw DataError("is not a BMP");
  const std::uint32_t first = numberAt(bytes, 10, 4);
  const std::uint32_t header = numberAt(bytes, 14, 4);
  const std::uint32_t width = numberAt(bytes, 18, 4);
  const auto rows = static_cast<std::int32_t>(numberAt(bytes, 22, 4));
  const std::uint32_t height = rows < 0 ? 0U - static_cast<std::uint32_t>(rows) : rows;
  if (header < info_header_bytes || numberAt(bytes, 28, 2) != 1 || numberAt(bytes, 30, 4) != 0)
    throw DataError("is not an uncompressed BMP of one bit a pixel");
  if (check) check(width, height);
  constexpr std::uint32_t widest = 1 << 24;
  if (width == 0 || height == 0 || width > widest || height > widest)
    throw DataError("is a BMP without pixels, or with more than can be counted");
  const std::size_t row_bytes = rowBytes(width);
  const std::size_t colours = file_header_bytes + std::size_t{header};
  if (first < colours + 8 || first > bytes.size() || (bytes.size() - first) / row_bytes < height)
    throw DataError("is a BMP that ends before its last row");
  const auto lightness = [&](std::size_t index) {
    return numberAt(bytes, colours + 4 * index, 1) + numberAt(bytes, colours + 4 * index + 1, 1) +
           numberAt(bytes, colours + 4 * index + 2, 1);
  };
  constexpr std::uint32_t half = 3 * 128;
  const std::array<std::uint32_t, 2> values{lightness(0) >= half, lightness(1) >= half};
  SpansBuilder builder(width);
  for (std::uint32_t y = 0; y < height; ++y) {
    const std::uint32_t stored = rows < 0 ? y : height - 1 - y;
    const std::uint8_t* row = bytes.data() + first + row_bytes * stored;
    for (std::uint32_t x = 0; x < width; ++x)
      builder.pixel(x, values[row[x / 8] >> (7 - x % 8) & 1]);
    builder.endRow();
  }
  return builder.finish();
}

}  // namespace vdbdither
