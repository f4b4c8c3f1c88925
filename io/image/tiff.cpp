#include "io/image/tiff.h"

#include <algorithm>
#include <array>
#include <cstdio>
#include <memory>
#include <string>
#include <tiffio.h>

#include "vdbdither/model/errors.h"

namespace vdbdither {

namespace {

/// What libtiff takes for a file.
struct Memory {
  std::vector<std::uint8_t> bytes;
  std::size_t position = 0;
  std::string error;  ///< what libtiff last complained of
};

Memory& memoryOf(thandle_t handle) { return *static_cast<Memory*>(handle); }

tmsize_t readMemory(thandle_t handle, void* data, tmsize_t size) {
  Memory& memory = memoryOf(handle);
  const std::size_t begin = std::min(memory.position, memory.bytes.size());
  const std::size_t count = std::min<std::size_t>(size, memory.bytes.size() - begin);
  std::copy_n(memory.bytes.data() + begin, count, static_cast<std::uint8_t*>(data));
  memory.position = begin + count;
  return static_cast<tmsize_t>(count);
}

tmsize_t writeMemory(thandle_t handle, void* data, tmsize_t size) {
  Memory& memory = memoryOf(handle);
  const auto end = memory.position + static_cast<std::size_t>(size);
  if (end > memory.bytes.size()) memory.bytes.resize(end);
  std::copy_n(static_cast<const std::uint8_t*>(data), size, memory.bytes.data() + memory.position);
  memory.position = end;
  return size;
}

toff_t seekMemory(thandle_t handle, toff_t offset, int whence) {
  Memory& memory = memoryOf(handle);
  const std::size_t from = whence == SEEK_SET   ? 0
                           : whence == SEEK_CUR ? memory.position
                                                : memory.bytes.size();
  memory.position = from + offset;
  return memory.position;
}

int closeMemory(thandle_t) { return 0; }
toff_t sizeOfMemory(thandle_t handle) { return memoryOf(handle).bytes.size(); }

int noteError(TIFF*, void* user, const char*, const char* format, va_list arguments) {
  std::array<char, 256> text{};
  std::vsnprintf(text.data(), text.size(), format, arguments);
  static_cast<Memory*>(user)->error = text.data();
  return 1;
}

int ignoreWarning(TIFF*, void*, const char*, const char*, va_list) { return 1; }

/// What a header may make libtiff allocate, in bytes.
constexpr tmsize_t most_at_once = tmsize_t{1} << 28;

using TiffHandle = std::unique_ptr<TIFF, decltype(&TIFFClose)>;

TiffHandle open(Memory& memory, const char* mode) {
  const std::unique_ptr<TIFFOpenOptions, decltype(&TIFFOpenOptionsFree)> options(
      TIFFOpenOptionsAlloc(), TIFFOpenOptionsFree);
  TIFFOpenOptionsSetErrorHandlerExtR(options.get(), noteError, &memory);
  TIFFOpenOptionsSetWarningHandlerExtR(options.get(), ignoreWarning, nullptr);
  TIFFOpenOptionsSetMaxSingleMemAlloc(options.get(), most_at_once);
  return {TIFFClientOpenExt("memory", mode, &memory, readMemory, writeMemory, seekMemory,
                            closeMemory, sizeOfMemory, nullptr, nullptr, options.get()),
          TIFFClose};
}

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
  Memory memory;
  // Little-endian on every machine.
  TiffHandle tiff = open(memory, "wl");
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
  return std::move(memory.bytes);
}

SpanImage decodeTiff(std::span<const std::uint8_t> bytes, const SizeCheck& check) {
  Memory memory{{bytes.begin(), bytes.end()}, 0, ""};
  const TiffHandle tiff = open(memory, "r");
  const auto refuse = [&] { return DataError("is no readable TIFF: it is damaged"); };
  if (!tiff) throw refuse();
  std::uint32_t width = 0;
  std::uint32_t height = 0;
  std::uint16_t depth = 1;
  std::uint16_t samples = 1;
  std::uint16_t meaning = PHOTOMETRIC_MINISBLACK;
  TIFFGetField(tiff.get(), TIFFTAG_IMAGEWIDTH, &width);
  TIFFGetField(tiff.get(), TIFFTAG_IMAGELENGTH, &height);
  TIFFGetFieldDefaulted(tiff.get(), TIFFTAG_BITSPERSAMPLE, &depth);
  TIFFGetFieldDefaulted(tiff.get(), TIFFTAG_SAMPLESPERPIXEL, &samples);
  TIFFGetField(tiff.get(), TIFFTAG_PHOTOMETRIC, &meaning);
  if (check) check(width, height);
  if ((depth != 1 && depth != 8) || samples != 1 || TIFFIsTiled(tiff.get()))
    throw DataError("is a TIFF of another kind: one sample of 1 or 8 bits is wanted, in strips");
  const std::uint32_t flip = depth == 1 && meaning == PHOTOMETRIC_MINISWHITE ? 1 : 0;
  SpansBuilder spans(width);
  std::vector<std::uint8_t> row(static_cast<std::size_t>(TIFFScanlineSize(tiff.get())));
  for (std::uint32_t y = 0; y < height; ++y) {
    if (TIFFReadScanline(tiff.get(), row.data(), y) != 1) throw refuse();
    for (std::uint32_t x = 0; x < width; ++x)
      spans.pixel(x, depth == 8 ? row[x] : (row[x / 8] >> (7 - x % 8) & 1U) ^ flip);
    spans.endRow();
  }
  if (!memory.error.empty()) throw refuse();
  return spans.finish();
}

}  // namespace vdbdither
