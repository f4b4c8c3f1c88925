#include "io/image/png_spans.h"

#include <cmath>
#include <cstdlib>
#include <functional>
#include <random>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <spng.h>

#include "io/file/staged_output.h"
#include "tests/support/png_reader.h"
#include "tests/support/scratch_folder.h"
#include "tests/support/span_images.h"
#include "vdbdither/model/errors.h"

namespace vdbdither {
namespace {

using test::PngImage;
using test::readPng;
using test::spanImage;

std::vector<std::uint8_t> decodeBySpng(const std::vector<std::uint8_t>& bytes) {
  spng_ctx* context = spng_ctx_new(0);
  EXPECT_EQ(spng_set_crc_action(context, SPNG_CRC_ERROR, SPNG_CRC_ERROR), 0);
  spng_set_image_limits(context, 1 << 25, 1 << 25);
  spng_set_png_buffer(context, bytes.data(), bytes.size());
  std::size_t size = 0;
  EXPECT_EQ(spng_decoded_image_size(context, SPNG_FMT_RAW, &size), 0);
  std::vector<std::uint8_t> rows(size);
  const int failed = spng_decode_image(context, rows.data(), rows.size(), SPNG_FMT_RAW, 0);
  EXPECT_EQ(failed, 0) << spng_strerror(failed);
  spng_ctx_free(context);
  return rows;
}

/// What the rows must hold, from the definition.
std::vector<std::uint8_t> pixelBytes(const SpanImage& image, const PngFormat& format) {
  std::vector<std::uint8_t> bytes;
  for (std::uint32_t y = 0; y < image.height; ++y) {
    std::uint32_t x = 0;
    const std::size_t row_begin = bytes.size();
    for (const Span& span : image.row(y)) {
      const std::uint32_t pixel = format.palette.empty() ? span.value : format.palette[span.value];
      for (; x < span.end; ++x) {
        if (format.pixels == PngPixels::rgba8) {
          for (int shift = 0; shift < 32; shift += 8)
            bytes.push_back(static_cast<std::uint8_t>(pixel >> shift));
        } else if (format.pixels == PngPixels::grey8) {
          bytes.push_back(static_cast<std::uint8_t>(pixel));
        } else {
          if (x % 8 == 0) bytes.push_back(0);
          if (pixel) bytes[row_begin + x / 8] |= static_cast<std::uint8_t>(128 >> x % 8);
        }
      }
    }
  }
  return bytes;
}

void expectDecodes(const SpanImage& image, const PngFormat& format) {
  const std::vector<std::uint8_t> bytes = encodePng(image, format);
  const std::vector<std::uint8_t> expected = pixelBytes(image, format);
  const PngImage decoded = readPng(bytes);
  EXPECT_EQ(decoded.width, image.width);
  EXPECT_EQ(decoded.height, image.height);
  EXPECT_EQ(decoded.bit_depth, format.pixels == PngPixels::grey1 ? 1 : 8);
  EXPECT_EQ(decoded.colour_type, format.pixels == PngPixels::rgba8 ? 6 : 0);
  EXPECT_TRUE(decoded.rows == expected) << "by libpng, " << image.width << " x " << image.height;
  EXPECT_TRUE(decodeBySpng(bytes) == expected)
      << "by spng, " << image.width << " x " << image.height;
}

void expectDecodesInEveryFormat(const SpanImage& image, std::span<const std::uint32_t> colours) {
  expectDecodes(image, {PngPixels::rgba8, colours, 0, 0});
  std::vector<std::uint32_t> greys;
  std::vector<std::uint32_t> bits;
  for (std::size_t i = 0; i < colours.size(); ++i) {
    greys.push_back(
        static_cast<std::uint32_t>(i * 255 / std::max<std::size_t>(1, colours.size() - 1)));
    bits.push_back(i % 2);
  }
  expectDecodes(image, {PngPixels::grey8, greys, 0, 0});
  expectDecodes(image, {PngPixels::grey1, bits, 0, 0});
}

const std::vector<std::uint32_t> colours = {rgba(0, 0, 0),     rgba(240, 240, 240),
                                            rgba(26, 26, 29),  rgba(0, 90, 158),
                                            rgba(166, 33, 98), rgba(200, 189, 3, 17)};

TEST(PngSpans, OnePixel) {
  for (std::uint32_t value = 0; value < 2; ++value) {
    expectDecodesInEveryFormat(spanImage(1, 1, [&](int, int) { return value; }), colours);
  }
}

TEST(PngSpans, EverySmallSizeOfNoise) {
  std::mt19937 random(1);
  for (int width = 1; width <= 20; ++width) {
    for (int height = 1; height <= 7; ++height) {
      const SpanImage image =
          spanImage(width, height, [&](int, int) { return random() % colours.size(); });
      expectDecodesInEveryFormat(image, colours);
    }
  }
}

TEST(PngSpans, EqualImagesOfEverySmallWidthWhereMatchesCrossManyRows) {
  for (int width = 1; width <= 70; ++width) {
    expectDecodesInEveryFormat(spanImage(width, 300, [](int, int) { return 1U; }), colours);
  }
}

TEST(PngSpans, SpansOfEveryRemainderOfTheLongestMatch) {
  const SpanImage image = spanImage(700, 700, [](int x, int y) { return x < y ? 1U : 0U; });
  expectDecodesInEveryFormat(image, colours);
}

TEST(PngSpans, SliceWithDitheredRim) {
  for (const std::uint32_t seed : {1, 2}) {
    expectDecodesInEveryFormat(test::ditheredDisc(601, 307, 6, seed), colours);
  }
}

TEST(PngSpans, NoiseOfTwoAndSixColoursOverManyBlocks) {
  std::mt19937 random(3);
  expectDecodesInEveryFormat(spanImage(900, 300, [&](int, int) { return random() % 2; }), colours);
  expectDecodesInEveryFormat(spanImage(900, 300, [&](int, int) { return random() % 6; }), colours);
}

TEST(PngSpans, NoiseOfPixelValuesWithoutPalette) {
  std::mt19937 random(4);
  expectDecodes(spanImage(300, 200, [&](int, int) { return static_cast<std::uint32_t>(random()); }),
                {});
}

TEST(PngSpans, RowsJustInsideAndOutsideTheWindow) {
  std::mt19937 random(5);
  for (const int width : {8190, 8191, 8192, 8193, 32766, 32767, 32768, 32769, 70000}) {
    const SpanImage image = spanImage(width, 6, [&](int x, int y) {
      return x / 50 % 7 == 0 ? static_cast<std::uint32_t>(random() % 3)
                             : static_cast<std::uint32_t>((x + y) / 900 % 4);
    });
    expectDecodesInEveryFormat(image, colours);
  }
}

TEST(PngSpans, BitsAcrossByteBorders) {
  std::mt19937 random(6);
  for (int round = 0; round < 200; ++round) {
    const int width = 1 + static_cast<int>(random() % 90);
    const auto sparse = static_cast<std::uint32_t>(1 + random() % 12);
    const SpanImage image =
        spanImage(width, 4, [&](int, int) { return random() % sparse == 0 ? 1U : 0U; });
    expectDecodes(image, {PngPixels::grey1, {}, 0, 0});
  }
}

TEST(PngSpans, NeighbouringSpansOfOneColourAreOne) {
  const SpanImage image =
      spanImage(500, 20, [](int x, int) { return static_cast<std::uint32_t>(x / 3 % 4); });
  const std::vector<std::uint32_t> palette = {7, 7, 7, 7};
  expectDecodes(image, {PngPixels::rgba8, palette, 0, 0});
  EXPECT_EQ(encodePng(image, {PngPixels::rgba8, palette, 0, 0}),
            encodePng(spanImage(500, 20, [](int, int) { return 7U; }), {}));
}

TEST(PngSpans, PillowReadsTheSamePixels) {
  if (std::system("/usr/bin/python3 -c 'import PIL.Image' 2>/dev/null") != 0)
    GTEST_SKIP() << "no Pillow here";
  const test::ScratchFolder scratch;
  const SpanImage image = test::ditheredDisc(601, 307, 20, 7);
  const std::vector<std::uint32_t> greys = {9, 200};
  for (const PngFormat& format :
       {PngFormat{PngPixels::rgba8, colours, 0, 0}, PngFormat{PngPixels::grey8, greys, 0, 0},
        PngFormat{PngPixels::grey1, {}, 0, 0}}) {
    const std::string png = scratch / "image.png";
    const std::string raw = scratch / "image.raw";
    writeFile(png, encodePng(image, format), png);
    const std::string script =
        "import PIL.Image as I; open('" + raw + "', 'wb').write(I.open('" + png + "').tobytes())";
    ASSERT_EQ(std::system(("/usr/bin/python3 -c \"" + script + "\"").c_str()), 0);
    EXPECT_TRUE(test::fileBytes(raw) == pixelBytes(image, format));
  }
}

TEST(PngSpans, PixelSizeIsDotsPerMetre) {
  const SpanImage image = spanImage(3, 2, [](int, int) { return 0U; });
  const PngImage decoded =
      readPng(encodePng(image, {PngPixels::grey8, {}, 25.4 / 600, 25.4 / 300}));
  EXPECT_EQ(decoded.dots_per_metre_x, 23622U);
  EXPECT_EQ(decoded.dots_per_metre_y, 11811U);
}

TEST(PngSpans, BlankImageCostsTwoBitsPer258BytesAndAFewPerRow) {
  const SpanImage image = spanImage(2857, 1416, [](int, int) { return 1U; });
  const double bytes = 1416.0 * 2857 * 4;
  const PngFormat format{PngPixels::rgba8, colours, 0, 0};
  EXPECT_LT(static_cast<double>(encodePng(image, format).size()), bytes / 258 / 4 + 1416 * 3 + 200);
  expectDecodes(image, format);
}

/// An image of one span a row.
SpanImage plain(std::uint32_t width, std::uint32_t height, std::uint32_t value) {
  SpanImage image{width, height, {0}, {}};
  for (std::uint32_t y = 0; y < height; ++y) {
    image.spans.push_back({width, value});
    image.row_begin.push_back(image.spans.size());
  }
  return image;
}

/// Sums over a run exceed 32 bits here, and its length the modulus of Adler-32; zlib, in libpng and
/// spng, refuses a wrong sum.
TEST(PngSpans, RunsLongerThanTheModulusOfAdler32Decode) {
  expectDecodes(plain(70000, 2, rgba(250, 251, 252, 253)), {});
  expectDecodes(plain(300000, 1, rgba(255, 255, 255, 255)), {});
  expectDecodes(plain(300000, 1, 255), {PngPixels::grey8, {}, 0, 0});
  expectDecodes(plain(600000, 2, 1), {PngPixels::grey1, {}, 0, 0});
}

TEST(PngSpans, AnImageThatIsTooWideIsRefused) {
  EXPECT_NO_THROW(encodePng(plain(1 << 24, 1, 0), {PngPixels::grey1, {}, 0, 0}));
  EXPECT_THAT(
      [] {
        encodePng(plain((1 << 24) + 1, 1, 0), {PngPixels::grey1, {}, 0, 0});
      },
      testing::ThrowsMessage<DataError>(
          "an image of 16777217 x 1 pixels cannot be a PNG; each side must have 1 to 16777216"));
}

TEST(PngSpans, AnImageWithoutPixelsIsRefused) {
  EXPECT_THAT(
      [] {
        encodePng(SpanImage{0, 3, {0, 0, 0, 0}, {}}, {});
      },
      testing::ThrowsMessage<DataError>(
          "an image of 0 x 3 pixels cannot be a PNG; each side must have 1 to 16777216"));
}

}  // namespace
}  // namespace vdbdither
