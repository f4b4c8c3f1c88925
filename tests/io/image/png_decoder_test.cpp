#include "io/image/png_decoder.h"

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
                ThrowsMessage<DataError>(HasSubstr("is no readable PNG: ")));
  }
  bytes[bytes.size() / 2] ^= 16;
  EXPECT_THROW(decodePng(bytes), DataError);
}

}  // namespace
}  // namespace vdbdither
