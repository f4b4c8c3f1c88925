#include "io/image/png_decoder.h"

#include <string>
#include <vector>
#include <zlib.h>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "io/image/png_spans.h"
#include "tests/support/span_images.h"
#include "vdbdither/model/errors.h"

namespace vdbdither {
namespace {

using testing::HasSubstr;
using testing::ThrowsMessage;

const std::vector<std::uint32_t> colours = {rgba(0, 0, 0, 0), rgba(240, 10, 20, 255),
                                            rgba(1, 2, 3, 4)};

SpanImage image() {
  return test::spanImage(37, 21,
                         [](int x, int y) { return static_cast<std::uint32_t>((x / 3 + y) % 3); });
}

SpanImage mapped(SpanImage picture, const std::vector<std::uint32_t>& palette) {
  for (Span& span : picture.spans) span.value = palette[span.value];
  return picture;
}

TEST(PngDecoder, ColoursComeBack) {
  EXPECT_EQ(decodePng(encodePng(image(), {PngPixels::rgba8, colours, 0, 0})),
            mapped(image(), colours));
}

TEST(PngDecoder, GreyAndBitsComeAsOpaqueColours) {
  const std::vector<std::uint32_t> greys = {0, 255, 99};
  EXPECT_EQ(decodePng(encodePng(image(), {PngPixels::grey8, greys, 0, 0})),
            mapped(image(), {rgba(0, 0, 0), rgba(255, 255, 255), rgba(99, 99, 99)}));
  const auto bits =
      test::spanImage(11, 5, [](int x, int y) { return static_cast<std::uint32_t>((x + y) % 2); });
  EXPECT_EQ(decodePng(encodePng(bits, {PngPixels::grey1, {}, 0, 0})),
            mapped(bits, {rgba(0, 0, 0), rgba(255, 255, 255)}));
}

TEST(PngDecoder, DamageIsAnError) {
  auto bytes = encodePng(image(), {PngPixels::rgba8, colours, 0, 0});
  for (std::size_t size = 0; size < bytes.size(); size += 13) {
    const std::vector<std::uint8_t> part(bytes.begin(),
                                         bytes.begin() + static_cast<std::ptrdiff_t>(size));
    EXPECT_THAT([&] { decodePng(part); },
                ThrowsMessage<DataError>(HasSubstr("is not a readable PNG: ")));
  }
  bytes[bytes.size() / 2] ^= 16;
  EXPECT_THROW(decodePng(bytes), DataError);
}

void append(std::vector<std::uint8_t>& bytes, std::uint32_t value) {
  for (int shift = 24; shift >= 0; shift -= 8)
    bytes.push_back(static_cast<std::uint8_t>(value >> shift));
}

/// The bytes of a PNG chunk.
std::vector<std::uint8_t> chunk(const std::string& type, const std::vector<std::uint8_t>& data) {
  std::vector<std::uint8_t> bytes;
  append(bytes, static_cast<std::uint32_t>(data.size()));
  bytes.insert(bytes.end(), type.begin(), type.end());
  bytes.insert(bytes.end(), data.begin(), data.end());
  append(bytes, static_cast<std::uint32_t>(
                    crc32(0, bytes.data() + 4, static_cast<uInt>(bytes.size() - 4))));
  return bytes;
}

std::vector<std::uint8_t> deflated(const std::vector<std::uint8_t>& data) {
  std::vector<std::uint8_t> packed(compressBound(data.size()));
  uLongf size = packed.size();
  EXPECT_EQ(compress2(packed.data(), &size, data.data(), data.size(), 9), Z_OK);
  packed.resize(size);
  return packed;
}

/// A grey image of 8 x 1 pixels with `pixels` for its rows, and `more` behind its header.
std::vector<std::uint8_t> tinyPng(const std::vector<std::uint8_t>& pixels,
                                  const std::vector<std::uint8_t>& more) {
  std::vector<std::uint8_t> bytes{0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n'};
  std::vector<std::uint8_t> header;
  append(header, 8);
  append(header, 1);
  header.insert(header.end(), {8, 0, 0, 0, 0});
  for (const std::vector<std::uint8_t>& part :
       {chunk("IHDR", header), more, chunk("IDAT", deflated(pixels)), chunk("IEND", {})})
    bytes.insert(bytes.end(), part.begin(), part.end());
  return bytes;
}

TEST(PngDecoder, DoesNotInflateWhatIsNoPixel) {
  const std::vector<std::uint8_t> zeros(std::size_t{128} << 20);
  const SpanImage black = decodePng(tinyPng({0, 0, 0, 0, 0, 0, 0, 0, 0}, {}));
  EXPECT_EQ(black.spans, (std::vector<Span>{{8, rgba(0, 0, 0)}}));
  std::vector<std::uint8_t> text{'k', 0, 0};
  const std::vector<std::uint8_t> packed = deflated(zeros);
  text.insert(text.end(), packed.begin(), packed.end());
  EXPECT_EQ(decodePng(tinyPng({0, 0, 0, 0, 0, 0, 0, 0, 0}, chunk("zTXt", text))), black);
  EXPECT_THAT([&] { decodePng(tinyPng(zeros, {})); },
              ThrowsMessage<DataError>("is not a readable PNG: it holds more than its pixels"));
}

}  // namespace
}  // namespace vdbdither
