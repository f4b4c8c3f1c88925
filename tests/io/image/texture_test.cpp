#include "io/image/texture.h"

#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "io/image/srgb.h"
#include "tests/support/textures.h"
#include "vdbdither/model/errors.h"

namespace vdbdither {
namespace {

using testing::ThrowsMessage;

TEST(Srgb, DecodesByTheStandard) {
  for (int i = 0; i <= 10000; ++i)
    EXPECT_NEAR(linearOfSrgb(i / 10000.0), test::srgbToLinear(i / 10000.0), 1e-15) << i;
  for (int i = 0; i < 256; ++i) {
    EXPECT_EQ(linearOfSrgbBytes()[static_cast<std::size_t>(i)],
              static_cast<float>(linearOfSrgb(i / 255.0)));
  }
}

TEST(Srgb, ClipsWhatIsOutside) {
  EXPECT_EQ(linearOfSrgb(-0.1), 0);
  EXPECT_EQ(linearOfSrgb(std::nan("")), 0);
  EXPECT_EQ(linearOfSrgb(1.5), 1);
  EXPECT_EQ(linearOfSrgb(0), 0);
  EXPECT_EQ(linearOfSrgb(1), 1);
}

TEST(Texture, NamesTheKindsThatAreNotRead) {
  using namespace std::string_literals;
  const std::vector<std::pair<std::string, std::string>> cases{
      {"\xABKTX 20\xBB\r\n\x1A\n"s, "KTX2"},
      {"\xABKTX 11\xBB\r\n\x1A\n"s, "KTX"},
      {"sB\x13\0M\0"s, "Basis"},
      {"DDS |\0\0\0"s, "DDS"},
      {"GIF89a\1\0\1\0"s, "GIF"},
      {"BM\x46\0\0\0"s, "BMP"},
      {"8BPS\0\1"s, "PSD"},
      {"#?RADIANCE\n"s, "Radiance HDR"},
      {"#?RGBE\n"s, "Radiance HDR"},
      {"\0\0\0\x20"
       "ftypavif"s,
       "AVIF"},
      {"\0\0\0\x20"
       "ftypheic"s,
       "HEIC"},
      {"\0\0\0\x0CjP  \r\n\x87\n"s, "JPEG 2000"},
      {"\xFF\x0A\0"s, "JPEG XL"},
      {"qoif\0"s, "QOI"},
      {"<svg xmlns='http://www.w3.org/2000/svg'/>"s, "SVG"},
      {"\xEF\xBB\xBF<?xml version='1.0'?>\n<!-- a -->\n<svg/>"s, "SVG"},
  };
  for (const auto& [bytes, name] : cases) {
    const std::string& text = bytes;
    EXPECT_THAT([&] { decodeTexture(text, "texture 'a'"); },
                ThrowsMessage<DataError>("texture 'a' is " + name +
                                         ", which is not read; save it as PNG, JPEG, WebP, TIFF or "
                                         "OpenEXR"));
  }
}

TEST(Texture, LimitsTheTexturesOfAMesh) {
  EXPECT_NO_THROW(checkTexturesTogether(1 << 24, 100));
  EXPECT_NO_THROW(checkTexturesTogether(1 << 26, 1 << 20));
  EXPECT_THAT([] { checkTexturesTogether(1 << 26, 1000); },
              ThrowsMessage<DataError>("have 67108864 pixels in 1000 bytes, too few for pictures; "
                                       "scale them down"));
  EXPECT_THAT(
      [] { checkTexturesTogether(most_texels + 1, most_texels); },
      ThrowsMessage<DataError>("have more than 268435456 pixels together; scale them down"));
}

TEST(Texture, RefusesWhatIsNoImage) {
  EXPECT_THAT([] { decodeTexture("", "texture 'a'"); },
              ThrowsMessage<DataError>("texture 'a' is empty; save it again"));
  for (const char* text : {"x", "RIFF1234WAVEfmt ", "solid cube", "<html>", "P6 1 1 255"}) {
    EXPECT_THAT(
        [&] { decodeTexture(text, "texture 'a'"); },
        ThrowsMessage<DataError>("texture 'a' is not an image in a format that is read; save it "
                                 "as PNG, JPEG, WebP, TIFF or OpenEXR"));
  }
}

}  // namespace
}  // namespace vdbdither
