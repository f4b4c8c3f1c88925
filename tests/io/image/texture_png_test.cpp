#include <cmath>
#include <zlib.h>

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
using test::pngOf;
using test::Samples;
using test::srgbToLinear;
using testing::HasSubstr;

/// What the samples of a PNG mean where it says nothing of its colours.
Colour srgbColour(const Samples& samples, std::uint32_t x, std::uint32_t y) {
  const bool has_opacity = samples.channels % 2 == 0;
  const auto light = [&](int channel) {
    return srgbToLinear(samples.share(x, y, samples.channels < 3 ? 0 : channel));
  };
  return {light(0), light(1), light(2),
          has_opacity ? samples.share(x, y, samples.channels - 1) : 1};
}

TEST(TexturePng, ReadsEveryKindOfPixel) {
  for (const int bits : {8, 16}) {
    for (int channels = 1; channels <= 4; ++channels) {
      for (const bool is_interlaced : {false, true}) {
        SCOPED_TRACE(std::to_string(bits) + " bits, " + std::to_string(channels) + " channels" +
                     (is_interlaced ? ", interlaced" : ""));
        const Samples samples = pattern(19, 11, channels, bits);
        expectTexels(decoded(pngOf(samples, is_interlaced)), 19, 11,
                     [&](auto x, auto y) { return srgbColour(samples, x, y); });
      }
    }
  }
}

TEST(TexturePng, ReadsTinyInterlacedImages) {
  for (std::uint32_t width = 1; width <= 5; ++width) {
    for (std::uint32_t height = 1; height <= 5; ++height) {
      const Samples samples = pattern(width, height, 3);
      expectTexels(decoded(pngOf(samples, true)), width, height,
                   [&](auto x, auto y) { return srgbColour(samples, x, y); });
    }
  }
}

TEST(TexturePng, IgnoresOpacityWhereTold) {
  const Samples samples = pattern(9, 5, 4);
  expectTexels(decoded(pngOf(samples), TextureOpacity::ignore), 9, 5, [&](auto x, auto y) {
    const Colour colour = srgbColour(samples, x, y);
    return Colour{colour[0], colour[1], colour[2], 1};
  });
}

TEST(TexturePng, HonoursGamma) {
  const Samples samples = pattern(9, 5, 3);
  for (const double gamma : {1.0, 1 / 2.2, 0.5}) {
    expectTexels(decoded(pngOf(samples, false, {.gamma = gamma})), 9, 5, [&](auto x, auto y) {
      const auto light = [&](int i) {
        return std::pow(samples.share(x, y, i), 1 / (std::round(gamma * 1e5) / 1e5));
      };
      return Colour{light(0), light(1), light(2), 1};
    });
  }
}

TEST(TexturePng, TheChunkSrgbComesBeforeGamma) {
  const Samples samples = pattern(9, 5, 3);
  expectTexels(decoded(pngOf(samples, false, {.gamma = 1 / 2.2, .is_srgb = true})), 9, 5,
               [&](auto x, auto y) { return srgbColour(samples, x, y); });
}

TEST(TexturePng, HonoursPrimaries) {
  // The primaries of Rec. 709 in another order, so that the channels change places.
  const std::array<double, 8> swapped{0.3127, 0.3290, 0.30, 0.60, 0.15, 0.06, 0.64, 0.33};
  const Samples samples = pattern(9, 5, 4, 16);
  expectTexels(
      decoded(pngOf(samples, false, {.gamma = 1, .chromaticities = swapped})), 9, 5,
      [&](auto x, auto y) {
        return Colour{samples.share(x, y, 2), samples.share(x, y, 0), samples.share(x, y, 1),
                      samples.share(x, y, 3)};
      },
      1e-4);
  expectTexels(
      decoded(pngOf(samples, false, {.chromaticities = swapped})), 9, 5,
      [&](auto x, auto y) {
        const auto light = [&](int i) { return srgbToLinear(samples.share(x, y, i)); };
        return Colour{light(2), light(0), light(1), samples.share(x, y, 3)};
      },
      1e-4);
}

TEST(TexturePng, HonoursProfiles) {
  for (const int bits : {8, 16}) {
    const Samples samples = pattern(9, 5, 4, bits);
    expectTexels(
        decoded(pngOf(samples, false, {.icc_profile = test::swappedProfile(1.8)})), 9, 5,
        [&](auto x, auto y) {
          const auto light = [&](int i) { return std::pow(samples.share(x, y, i), 1.8); };
          return Colour{light(2), light(0), light(1), samples.share(x, y, 3)};
        },
        2e-4);
  }
  const Samples grey = pattern(9, 5, 1);
  expectTexels(
      decoded(pngOf(grey, false, {.icc_profile = test::greyProfile(1.8)})), 9, 5,
      [&](auto x, auto y) {
        const double light = std::pow(grey.share(x, y, 0), 1.8);
        return Colour{light, light, light, 1};
      },
      2e-4);
}

TEST(TexturePng, HonoursProfilesOfTables) {
  const Samples samples = pattern(9, 5, 3);
  expectTexels(
      decoded(pngOf(samples, false, {.icc_profile = test::tableProfile(3)})), 9, 5,
      [&](auto x, auto y) {
        return Colour{samples.share(x, y, 1), samples.share(x, y, 2), samples.share(x, y, 0), 1};
      },
      0.015);
}

void append(Bytes& bytes, std::uint32_t value) {
  for (int shift = 24; shift >= 0; shift -= 8)
    bytes.push_back(static_cast<std::uint8_t>(value >> shift));
}

void appendChunk(Bytes& bytes, const std::string& type, const Bytes& data) {
  append(bytes, static_cast<std::uint32_t>(data.size()));
  const std::size_t begin = bytes.size();
  bytes.insert(bytes.end(), type.begin(), type.end());
  bytes.insert(bytes.end(), data.begin(), data.end());
  append(bytes, static_cast<std::uint32_t>(
                    crc32(0, bytes.data() + begin, static_cast<uInt>(bytes.size() - begin))));
}

Bytes deflated(const Bytes& data) {
  Bytes packed(compressBound(data.size()));
  uLongf size = packed.size();
  EXPECT_EQ(compress2(packed.data(), &size, data.data(), data.size(), 9), Z_OK);
  packed.resize(size);
  return packed;
}

/// A PNG of these chunks, with a header of this size and kind.
Bytes pngOfChunks(std::uint32_t width, std::uint32_t height, std::uint8_t bits, std::uint8_t kind,
                  const std::vector<std::pair<std::string, Bytes>>& chunks) {
  Bytes bytes{0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n'};
  Bytes header;
  append(header, width);
  append(header, height);
  header.insert(header.end(), {bits, kind, 0, 0, 0});
  appendChunk(bytes, "IHDR", header);
  for (const auto& [type, data] : chunks) appendChunk(bytes, type, data);
  appendChunk(bytes, "IEND", {});
  return bytes;
}

constexpr std::uint8_t palette_kind = 3;

TEST(TexturePng, ReadsPalettesWithOpacity) {
  const Bytes colours{10, 20, 30, 200, 100, 0, 255, 255, 255};
  const Bytes opacities{128, 0};
  const Bytes rows{0, 0b00'01'10'00, 0, 0b10'10'01'00};
  const Bytes bytes = pngOfChunks(
      4, 2, 2, palette_kind, {{"PLTE", colours}, {"tRNS", opacities}, {"IDAT", deflated(rows)}});
  const std::array<std::array<std::size_t, 4>, 2> indices{{{0, 1, 2, 0}, {2, 2, 1, 0}}};
  expectTexels(decoded(bytes), 4, 2, [&](auto x, auto y) {
    const std::size_t index = indices[y][x];
    const auto light = [&](std::size_t i) { return srgbToLinear(colours[3 * index + i] / 255.0); };
    const double opacity = index < 2 ? opacities[index] / 255.0 : 1;
    return Colour{light(0), light(1), light(2), opacity};
  });
}

TEST(TexturePng, ReadsTheTransparentColour) {
  const Bytes bytes = pngOfChunks(2, 1, 8, 0, {{"tRNS", {0, 77}}, {"IDAT", deflated({0, 77, 78})}});
  expectTexels(decoded(bytes), 2, 1, [&](auto x, auto) {
    const double light = srgbToLinear((77 + x) / 255.0);
    return Colour{light, light, light, x == 0 ? 0.0 : 1.0};
  });
}

TEST(TexturePng, ABrokenProfileCountsAsNone) {
  const Bytes rows{0, 10, 200, 90};
  const Texture plain = decoded(pngOfChunks(1, 1, 8, 2, {{"IDAT", deflated(rows)}}));
  const auto withProfile = [&](const Bytes& profile) {
    Bytes chunk{'m', 0, 0};
    const Bytes packed = deflated(profile);
    chunk.insert(chunk.end(), packed.begin(), packed.end());
    return decoded(pngOfChunks(1, 1, 8, 2, {{"iCCP", chunk}, {"IDAT", deflated(rows)}}));
  };
  const Bytes good = test::swappedProfile(1.8);
  EXPECT_NE(withProfile(good).texels, plain.texels);
  Bytes spoilt = good;
  // Its head and its table stay, and where the tags lie is filled with nonsense.
  for (std::size_t i = 132 + 12 * spoilt[131]; i < spoilt.size(); ++i) spoilt[i] = 0xFF;
  EXPECT_EQ(withProfile(spoilt).texels, plain.texels);
  EXPECT_EQ(withProfile(Bytes(200, 0x77)).texels, plain.texels);
  EXPECT_EQ(withProfile({good.begin(), good.begin() + 100}).texels, plain.texels);
}

TEST(TexturePng, RefusesWhatIsDamaged) {
  const Bytes bytes = pngOf(pattern(7, 6, 3));
  test::expectPrefixesAreRefused(bytes);
  test::expectSpoiltImagesAreReadOrRefused(bytes);
  test::expectSpoiltImagesAreReadOrRefused(
      pngOf(pattern(7, 6, 4, 16), true, {.icc_profile = test::swappedProfile(1.8)}));
  EXPECT_THAT(test::textureRefusal({bytes.begin(), bytes.end() - 20}),
              HasSubstr("texture 'a' is not a readable PNG: it is cut short"));
}

TEST(TexturePng, RefusesPixelsThatCannotBeInTheFile) {
  const Bytes few = deflated(Bytes(4000));
  EXPECT_EQ(test::textureRefusal(pngOfChunks(4096, 4096, 8, 2, {{"IDAT", few}})),
            "texture 'a' is not a readable PNG: it is cut short");
  EXPECT_THAT(test::textureRefusal(pngOfChunks(16000, 16000, 8, 2, {{"IDAT", few}})),
              HasSubstr("texture 'a' has 16000 x 16000 pixels in "));
  EXPECT_EQ(test::textureRefusal(pngOfChunks(100000, 100000, 8, 2, {{"IDAT", few}})),
            "texture 'a' has 100000 x 100000 pixels; at most 268435456 are read; scale it down");
  EXPECT_EQ(test::textureRefusal(
                pngOfChunks(8, 1, 8, 0, {{"IDAT", deflated(Bytes(std::size_t{64} << 20))}})),
            "texture 'a' is not a readable PNG: it holds more than its pixels");
}

}  // namespace
}  // namespace vdbdither
