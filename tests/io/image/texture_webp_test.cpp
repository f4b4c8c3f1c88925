#include <cmath>
#include <cstring>
#include <webp/encode.h>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/textures.h"

namespace vdbdither {
namespace {

using test::Bytes;
using test::Colour;
using test::decoded;
using test::expectTexels;
using test::pattern;
using test::Samples;
using test::srgbToLinear;
using testing::HasSubstr;

Bytes webpOf(const Samples& samples, bool is_lossy = false) {
  std::uint8_t* data = nullptr;
  const Bytes packed = samples.packed();
  const auto width = static_cast<int>(samples.width);
  const auto height = static_cast<int>(samples.height);
  const int stride = width * samples.channels;
  std::size_t size = 0;
  if (samples.channels == 3) {
    size = is_lossy ? WebPEncodeRGB(packed.data(), width, height, stride, 100, &data)
                    : WebPEncodeLosslessRGB(packed.data(), width, height, stride, &data);
  } else {
    size = is_lossy ? WebPEncodeRGBA(packed.data(), width, height, stride, 100, &data)
                    : WebPEncodeLosslessRGBA(packed.data(), width, height, stride, &data);
  }
  Bytes bytes(data, data + size);
  WebPFree(data);
  return bytes;
}

void appendSize(Bytes& bytes, std::size_t size, int count) {
  for (int i = 0; i < count; ++i) bytes.push_back(static_cast<std::uint8_t>(size >> 8 * i));
}

void appendChunk(Bytes& bytes, const std::string& name, const Bytes& data) {
  bytes.insert(bytes.end(), name.begin(), name.end());
  appendSize(bytes, data.size(), 4);
  bytes.insert(bytes.end(), data.begin(), data.end());
  if (data.size() % 2 != 0) bytes.push_back(0);
}

/// The extended form of a simple file: with these flags and a chunk in front of the image.
Bytes extended(const Bytes& simple, const Samples& samples, std::uint8_t flags,
               const std::string& name, const Bytes& data) {
  Bytes content{'W', 'E', 'B', 'P'};
  Bytes head{flags, 0, 0, 0};
  appendSize(head, samples.width - 1, 3);
  appendSize(head, samples.height - 1, 3);
  appendChunk(content, "VP8X", head);
  appendChunk(content, name, data);
  content.insert(content.end(), simple.begin() + 12, simple.end());
  Bytes bytes;
  appendChunk(bytes, "RIFF", content);
  return bytes;
}

TEST(TextureWebp, ReadsPixelsWithoutLoss) {
  for (const int channels : {3, 4}) {
    const Samples samples = pattern(19, 11, channels);
    const Texture texture = decoded(webpOf(samples));
    expectTexels(texture, 19, 11, [&](auto x, auto y) {
      const double opacity = channels == 4 ? samples.share(x, y, 3) : 1;
      // Clear pixels lose their colour.
      const auto light = [&](int i) { return srgbToLinear(samples.share(x, y, i)); };
      return Colour{light(0), light(1), light(2), opacity};
    });
  }
}

TEST(TextureWebp, ReadsLossyImagesTopRowFirst) {
  for (const int channels : {3, 4}) {
    Samples samples = pattern(32, 32, channels);
    std::size_t at = 0;
    for (std::uint16_t y = 0; y < 32; ++y) {
      for (std::uint16_t x = 0; x < 32; ++x) {
        for (int i = 0; i < channels; ++i)
          samples.values[at++] = static_cast<std::uint16_t>(i == 3 ? 100 + y : 60 + 2 * x + 3 * y);
      }
    }
    expectTexels(
        decoded(webpOf(samples, true)), 32, 32,
        [&](auto x, auto y) {
          const double light = srgbToLinear(samples.share(x, y, 0));
          return Colour{light, light, light, channels == 4 ? samples.share(x, y, 3) : 1};
        },
        0.05);
  }
}

TEST(TextureWebp, HonoursProfiles) {
  const Samples samples = pattern(19, 11, 3);
  constexpr std::uint8_t has_profile = 0x20;
  expectTexels(
      decoded(extended(webpOf(samples), samples, has_profile, "ICCP", test::swappedProfile(1.8))),
      19, 11,
      [&](auto x, auto y) {
        const auto light = [&](int i) { return std::pow(samples.share(x, y, i), 1.8); };
        return Colour{light(2), light(0), light(1), 1};
      },
      2e-4);
  EXPECT_EQ(
      decoded(extended(webpOf(samples), samples, has_profile, "ICCP", Bytes(200, 0x77))).texels,
      decoded(webpOf(samples)).texels);
}

TEST(TextureWebp, RefusesAnimationsAndDamage) {
  const Samples samples = pattern(19, 11, 3);
  const Bytes bytes = webpOf(samples);
  constexpr std::uint8_t is_animated = 0x02;
  EXPECT_EQ(test::textureRefusal(extended(bytes, samples, is_animated, "ANIM", Bytes(6))),
            "texture 'a' is an animation; save a single image");
  test::expectPrefixesAreRefused(bytes);
  test::expectPrefixesAreRefused(webpOf(samples, true));
  test::expectSpoiltImagesAreReadOrRefused(bytes);
  test::expectSpoiltImagesAreReadOrRefused(webpOf(pattern(19, 11, 4), true));
  EXPECT_THAT(test::textureRefusal({bytes.begin(), bytes.end() - 20}),
              HasSubstr("texture 'a' is not a readable WebP: it is damaged"));
}

TEST(TextureWebp, RefusesLargeImagesOfOneColour) {
  Samples samples{16000, 2000, 3, 8};
  samples.values.resize(std::size_t{16000} * 2000 * 3);
  EXPECT_THAT(test::textureRefusal(webpOf(samples)),
              HasSubstr("texture 'a' has 16000 x 2000 pixels in "));
}

}  // namespace
}  // namespace vdbdither
