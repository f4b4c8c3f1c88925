#include "io/image/tiff.h"

#include <algorithm>
#include <tiffio.h>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "io/file/staged_output.h"
#include "io/image/colour_image.h"
#include "io/image/png_spans.h"
#include "io/image/tiff_memory.h"
#include "tests/support/scratch_folder.h"
#include "tests/support/span_images.h"
#include "vdbdither/model/errors.h"

namespace vdbdither {
namespace {

using testing::HasSubstr;
using testing::ThrowsMessage;

const std::vector<std::uint32_t> palette = {rgba(0, 0, 0), rgba(240, 10, 20), rgba(1, 2, 3)};

std::uint32_t stripes(int x, int y) { return static_cast<std::uint32_t>((x / 3 + y) % 3); }

TEST(Tiff, PalettesKeepIndicesAndColours) {
  const test::ScratchFolder scratch;
  const auto bytes = encodeTiff(test::spanImage(37, 70, stripes), {palette, 0.042, 0.084});
  writeFile(scratch / "a.tif", bytes, "a.tif");
  TIFF* tiff = TIFFOpen((scratch / "a.tif").c_str(), "r");
  ASSERT_NE(tiff, nullptr);
  float across = 0;
  TIFFGetField(tiff, TIFFTAG_XRESOLUTION, &across);
  EXPECT_FLOAT_EQ(across, 10 / 0.042F);
  std::vector<std::uint32_t> raster(37 * 70);
  ASSERT_EQ(TIFFReadRGBAImageOriented(tiff, 37, 70, raster.data(), ORIENTATION_TOPLEFT, 1), 1);
  TIFFClose(tiff);
  for (int y = 0; y < 70; ++y) {
    for (int x = 0; x < 37; ++x)
      ASSERT_EQ(raster[y * 37 + x], palette[stripes(x, y)]) << x << " " << y;
  }
  EXPECT_EQ(decodeTiff(bytes), test::spanImage(37, 70, stripes));
}

TEST(Tiff, BitsComeBack) {
  for (const int width : {1, 7, 8, 9, 641}) {
    const auto bit = [](int x, int y) {
      return static_cast<std::uint32_t>((x * x + 3 * y) % 5 < 2);
    };
    const SpanImage image = test::spanImage(width, 20, bit);
    const auto bytes = encodeTiff(image, {{}, 1, 1});
    EXPECT_EQ(decodeTiff(bytes), image) << width;
    EXPECT_EQ(bytes, encodeTiff(image, {{}, 1, 1}));
  }
}

/// A TIFF of one row of grey.
std::vector<std::uint8_t> greyTiff(std::uint32_t width, std::uint16_t bits, std::uint16_t meaning,
                                   std::vector<std::uint8_t> row) {
  TiffMemory memory;
  {
    const TiffHandle tiff = openTiff(memory, "wl");
    TIFFSetField(tiff.get(), TIFFTAG_IMAGEWIDTH, width);
    TIFFSetField(tiff.get(), TIFFTAG_IMAGELENGTH, 1);
    TIFFSetField(tiff.get(), TIFFTAG_BITSPERSAMPLE, bits);
    TIFFSetField(tiff.get(), TIFFTAG_SAMPLESPERPIXEL, 1);
    TIFFSetField(tiff.get(), TIFFTAG_PLANARCONFIG, PLANARCONFIG_CONTIG);
    TIFFSetField(tiff.get(), TIFFTAG_PHOTOMETRIC, meaning);
    EXPECT_EQ(TIFFWriteScanline(tiff.get(), row.data(), 0), 1);
  }
  return memory.written;
}

const SizeCheck any_size = [](std::uint32_t, std::uint32_t) {};

std::vector<std::uint32_t> valuesOf(const SpanImage& image) {
  std::vector<std::uint32_t> values;
  for (const Span& span : image.spans) values.resize(span.end, span.value);
  return values;
}

TEST(Tiff, OfBitsWhoseZeroIsWhiteIsInverted) {
  using testing::ElementsAre;
  const std::vector<std::uint8_t> row{0b10110000};
  const auto black_is_zero = greyTiff(4, 1, PHOTOMETRIC_MINISBLACK, row);
  const auto white_is_zero = greyTiff(4, 1, PHOTOMETRIC_MINISWHITE, row);
  EXPECT_THAT(valuesOf(decodeTiff(black_is_zero)), ElementsAre(1, 0, 1, 1));
  EXPECT_THAT(valuesOf(decodeTiff(white_is_zero)), ElementsAre(0, 1, 0, 0));
  const std::uint32_t white = rgba(255, 255, 255);
  const std::uint32_t black = rgba(0, 0, 0);
  EXPECT_THAT(valuesOf(decodeTiffImage(black_is_zero, any_size).pixels),
              ElementsAre(white, black, white, white));
  EXPECT_THAT(valuesOf(decodeTiffImage(white_is_zero, any_size).pixels),
              ElementsAre(black, white, black, black));
}

TEST(Tiff, OfGreyWhoseZeroIsWhiteIsInvertedAsAColour) {
  using testing::ElementsAre;
  const auto colours = [](std::uint16_t bits, std::uint16_t meaning,
                          const std::vector<std::uint8_t>& row) {
    return valuesOf(decodeTiffImage(greyTiff(2, bits, meaning, row), any_size).pixels);
  };
  const std::uint32_t dark = rgba(1, 1, 1);
  const std::uint32_t light = rgba(254, 254, 254);
  EXPECT_THAT(colours(8, PHOTOMETRIC_MINISBLACK, {1, 254}), ElementsAre(dark, light));
  EXPECT_THAT(colours(8, PHOTOMETRIC_MINISWHITE, {1, 254}), ElementsAre(light, dark));
  EXPECT_THAT(colours(16, PHOTOMETRIC_MINISBLACK, {0, 1, 0, 254}), ElementsAre(dark, light));
  EXPECT_THAT(colours(16, PHOTOMETRIC_MINISWHITE, {0, 1, 0, 254}), ElementsAre(light, dark));
}

// Some of the packings of libtiff do not keep within the rows that are read.
TEST(Tiff, RefusesPackingsThatAreNotRead) {
  auto bytes = encodeTiff(test::spanImage(37, 70, stripes), {palette, 1, 1});
  // Tag 259, one number of 16 bits.
  const std::vector<std::uint8_t> tag = {0x03, 0x01, 3, 0, 1, 0, 0, 0};
  const auto packing = std::search(bytes.begin(), bytes.end(), tag.begin(), tag.end()) + 8;
  ASSERT_EQ(*packing, COMPRESSION_LZW);
  packing[0] = COMPRESSION_PIXARLOG & 255;
  packing[1] = COMPRESSION_PIXARLOG >> 8;
  EXPECT_THAT([&] { decodeTiff(bytes); },
              ThrowsMessage<DataError>(HasSubstr("is a TIFF packed in a way that is not read")));
}

TEST(Tiff, RefusesWhatItCannotReadOrWrite) {
  auto bytes = encodeTiff(test::spanImage(37, 70, stripes), {palette, 1, 1});
  const std::vector<std::uint8_t> text = {'n', 'o', 'n', 'e'};
  EXPECT_THAT([&] { decodeTiff(text); },
              ThrowsMessage<DataError>(HasSubstr("is not a readable TIFF: ")));
  for (const std::size_t size : {100, 50, 8, 7, 0}) {
    bytes.resize(size);
    EXPECT_THAT([&] { decodeTiff(bytes); },
                ThrowsMessage<DataError>(HasSubstr("is not a readable TIFF: ")));
  }
  EXPECT_THAT(
      [&] {
        encodeTiff(SpanImage{}, {palette, 1, 1});
      },
      ThrowsMessage<DataError>("an image without pixels is no TIFF"));
  EXPECT_NO_THROW(
      encodeTiff(test::spanImage(2, 2, stripes), {std::vector<std::uint32_t>(256), 1, 1}));
  const std::vector<std::uint32_t> many(257);
  EXPECT_THAT(
      [&] {
        encodeTiff(test::spanImage(2, 2, stripes), {many, 1, 1});
      },
      ThrowsMessage<DataError>("a TIFF has at most 256 colours"));
}

}  // namespace
}  // namespace vdbdither
