#include <cmath>
#include <cstring>
#include <functional>
#include <tiffio.h>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "io/file/whole_file.h"
#include "tests/support/scratch_folder.h"
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

struct TiffKind {
  std::uint16_t meaning = PHOTOMETRIC_RGB;
  std::uint16_t packing = COMPRESSION_LZW;
  std::uint16_t planes = PLANARCONFIG_CONTIG;
  std::uint16_t extra = 0xFFFF;  ///< what the sample after the colours is; none
  std::uint32_t tile = 0;        ///< edge of tiles, 0: strips
  std::uint32_t rows = 4;        ///< of a strip
  std::uint16_t orientation = ORIENTATION_TOPLEFT;
  std::uint16_t number_type = SAMPLEFORMAT_UINT;
  const char* mode = "w";
  Bytes profile{};
  std::vector<std::uint16_t> palette{};  ///< 256 reds, greens, blues
};

/// The samples of one plane or of all, of a piece of the image.
Bytes piece(const Samples& samples, const Bytes& packed, std::uint32_t left, std::uint32_t top,
            std::uint32_t width, std::uint32_t height, int plane) {
  const std::size_t sample_bytes = static_cast<std::size_t>(samples.bits) / 8;
  const auto channels = static_cast<std::size_t>(samples.channels);
  Bytes bytes;
  for (std::uint32_t y = top; y < top + height; ++y) {
    for (std::uint32_t x = left; x < left + width; ++x) {
      const std::size_t pixel = (std::size_t{std::min(y, samples.height - 1)} * samples.width +
                                 std::min(x, samples.width - 1)) *
                                channels;
      const std::size_t first = pixel + (plane < 0 ? 0 : static_cast<std::size_t>(plane));
      const std::size_t count = plane < 0 ? channels : 1;
      const auto begin = packed.begin() + static_cast<std::ptrdiff_t>(first * sample_bytes);
      bytes.insert(bytes.end(), begin, begin + static_cast<std::ptrdiff_t>(count * sample_bytes));
    }
  }
  return bytes;
}

/// A TIFF of samples whose bytes are `packed`.
Bytes tiffOf(const Samples& samples, const Bytes& packed, const TiffKind& kind) {
  const test::ScratchFolder scratch;
  TIFF* tiff = TIFFOpen((scratch / "a.tif").c_str(), kind.mode);
  TIFFSetField(tiff, TIFFTAG_IMAGEWIDTH, samples.width);
  TIFFSetField(tiff, TIFFTAG_IMAGELENGTH, samples.height);
  TIFFSetField(tiff, TIFFTAG_SAMPLESPERPIXEL, samples.channels);
  TIFFSetField(tiff, TIFFTAG_BITSPERSAMPLE, samples.bits);
  TIFFSetField(tiff, TIFFTAG_SAMPLEFORMAT, kind.number_type);
  TIFFSetField(tiff, TIFFTAG_COMPRESSION, kind.packing);
  TIFFSetField(tiff, TIFFTAG_PHOTOMETRIC, kind.meaning);
  TIFFSetField(tiff, TIFFTAG_PLANARCONFIG, kind.planes);
  TIFFSetField(tiff, TIFFTAG_ORIENTATION, kind.orientation);
  if (kind.extra != 0xFFFF) TIFFSetField(tiff, TIFFTAG_EXTRASAMPLES, 1, &kind.extra);
  if (!kind.profile.empty())
    TIFFSetField(tiff, TIFFTAG_ICCPROFILE, static_cast<std::uint32_t>(kind.profile.size()),
                 kind.profile.data());
  if (!kind.palette.empty())
    TIFFSetField(tiff, TIFFTAG_COLORMAP, &kind.palette[0], &kind.palette[256], &kind.palette[512]);
  const int planes = kind.planes == PLANARCONFIG_CONTIG ? 1 : samples.channels;
  if (kind.tile != 0) {
    TIFFSetField(tiff, TIFFTAG_TILEWIDTH, kind.tile);
    TIFFSetField(tiff, TIFFTAG_TILELENGTH, kind.tile);
  } else {
    TIFFSetField(tiff, TIFFTAG_ROWSPERSTRIP, kind.rows);
  }
  const std::uint32_t step_x = kind.tile != 0 ? kind.tile : samples.width;
  const std::uint32_t step_y = kind.tile != 0 ? kind.tile : kind.rows;
  for (int plane = 0; plane < planes; ++plane) {
    for (std::uint32_t y = 0; y < samples.height; y += step_y) {
      for (std::uint32_t x = 0; x < samples.width; x += step_x) {
        const std::uint32_t height = kind.tile != 0 ? step_y : std::min(step_y, samples.height - y);
        Bytes bytes = piece(samples, packed, x, y, step_x, height, planes == 1 ? -1 : plane);
        const auto size = static_cast<tmsize_t>(bytes.size());
        const auto number = static_cast<std::uint16_t>(plane);
        if (kind.tile != 0) {
          TIFFWriteEncodedTile(tiff, TIFFComputeTile(tiff, x, y, 0, number), bytes.data(), size);
        } else {
          TIFFWriteEncodedStrip(tiff, TIFFComputeStrip(tiff, y, number), bytes.data(), size);
        }
      }
    }
  }
  TIFFClose(tiff);
  return readWholeFile(scratch / "a.tif", "a.tif", 1 << 28);
}

Bytes tiffOf(const Samples& samples, const TiffKind& kind) {
  return tiffOf(samples, samples.packed(), kind);
}

Colour srgbColour(const Samples& samples, std::uint32_t x, std::uint32_t y) {
  const int colours = samples.channels < 3 ? 1 : 3;
  const auto light = [&](int i) { return srgbToLinear(samples.share(x, y, colours == 1 ? 0 : i)); };
  return {light(0), light(1), light(2),
          samples.channels > colours ? samples.share(x, y, colours) : 1};
}

TEST(TextureTiff, ReadsGreyAndColoursOfEightAndSixteenBits) {
  for (const int bits : {8, 16}) {
    for (int channels = 1; channels <= 4; ++channels) {
      for (const char* mode : {"wl", "wb", "w8"}) {
        SCOPED_TRACE(std::to_string(bits) + " bits, " + std::to_string(channels) + " channels " +
                     mode);
        const Samples samples = pattern(19, 11, channels, bits);
        TiffKind kind{.meaning = channels < 3 ? std::uint16_t{PHOTOMETRIC_MINISBLACK}
                                              : std::uint16_t{PHOTOMETRIC_RGB},
                      .mode = mode};
        if (channels % 2 == 0) kind.extra = EXTRASAMPLE_UNASSALPHA;
        expectTexels(decoded(tiffOf(samples, kind)), 19, 11,
                     [&](auto x, auto y) { return srgbColour(samples, x, y); });
      }
    }
  }
}

TEST(TextureTiff, ReadsTilesStripsPlanesAndPackings) {
  const Samples samples = pattern(37, 29, 4, 16);
  constexpr std::uint16_t packings[] = {COMPRESSION_NONE, COMPRESSION_LZW,
                                        COMPRESSION_ADOBE_DEFLATE, COMPRESSION_PACKBITS};
  constexpr std::uint16_t layouts[] = {PLANARCONFIG_CONTIG, PLANARCONFIG_SEPARATE};
  for (const std::uint16_t packing : packings) {
    for (const std::uint16_t planes : layouts) {
      for (const std::uint32_t tile : {0, 16}) {
        for (const std::uint32_t rows : {1, 8, 29}) {
          expectTexels(decoded(tiffOf(samples, {.packing = packing,
                                                .planes = planes,
                                                .extra = EXTRASAMPLE_UNASSALPHA,
                                                .tile = tile,
                                                .rows = rows})),
                       37, 29, [&](auto x, auto y) { return srgbColour(samples, x, y); });
        }
      }
    }
  }
}

TEST(TextureTiff, DividesByAssociatedOpacityBeforeDecoding) {
  Samples samples = pattern(19, 11, 4, 16);
  for (std::size_t i = 0; i < samples.values.size(); i += 4) {
    for (std::size_t c = 0; c < 3; ++c)
      samples.values[i + c] = std::min(samples.values[i + c], samples.values[i + 3]);
  }
  const Bytes bytes = tiffOf(samples, {.extra = EXTRASAMPLE_ASSOCALPHA});
  const auto straight = [&](std::uint32_t x, std::uint32_t y) {
    const double opacity = samples.share(x, y, 3);
    const auto light = [&](int i) {
      return opacity > 0 ? srgbToLinear(samples.share(x, y, i) / opacity) : 0;
    };
    return Colour{light(0), light(1), light(2), opacity};
  };
  expectTexels(decoded(bytes), 19, 11, straight, 3.0 / 65535);
  expectTexels(
      decoded(bytes, TextureOpacity::ignore), 19, 11,
      [&](auto x, auto y) {
        Colour colour = straight(x, y);
        colour[3] = 1;
        return colour;
      },
      3.0 / 65535);
}

TEST(TextureTiff, PassesOverSamplesWithoutMeaning) {
  const Samples samples = pattern(19, 11, 4);
  expectTexels(decoded(tiffOf(samples, {.extra = EXTRASAMPLE_UNSPECIFIED})), 19, 11,
               [&](auto x, auto y) {
                 Colour colour = srgbColour(samples, x, y);
                 colour[3] = 1;
                 return colour;
               });
}

TEST(TextureTiff, ReadsFloatsAsLinearLight) {
  const Samples shape{9, 5, 3, 32};
  std::vector<float> values(9 * 5 * 3);
  for (std::size_t i = 0; i < values.size(); ++i)
    values[i] = static_cast<float>(i % 17) / 12 - 0.1F;
  values[7] = std::nanf("");
  Bytes packed(values.size() * sizeof(float));
  std::memcpy(packed.data(), values.data(), packed.size());
  const Texture texture = decoded(tiffOf(shape, packed, {.number_type = SAMPLEFORMAT_IEEEFP}));
  expectTexels(texture, 9, 5, [&](auto x, auto y) {
    const auto light = [&](std::size_t i) {
      const double value = values[(y * 9 + x) * 3 + i];
      return std::isnan(value) ? 0 : std::min(1.0, std::max(0.0, value));
    };
    return Colour{light(0), light(1), light(2), 1};
  });
}

TEST(TextureTiff, ReadsHalves) {
  const Samples shape{2, 1, 1, 16};
  const Bytes packed{0x00, 0x38, 0x00, 0x34};  // 0.5 and 0.25
  expectTexels(
      decoded(tiffOf(
          shape, packed,
          {.meaning = PHOTOMETRIC_MINISBLACK, .number_type = SAMPLEFORMAT_IEEEFP, .mode = "wl"})),
      2, 1, [](auto x, auto) {
        const double light = x == 0 ? 0.5 : 0.25;
        return Colour{light, light, light, 1};
      });
}

TEST(TextureTiff, ReadsWhiteAsZero) {
  for (const int bits : {8, 16}) {
    const Samples samples = pattern(9, 5, 1, bits);
    expectTexels(decoded(tiffOf(samples, {.meaning = PHOTOMETRIC_MINISWHITE})), 9, 5,
                 [&](auto x, auto y) {
                   const double light = srgbToLinear(1 - samples.share(x, y, 0));
                   return Colour{light, light, light, 1};
                 });
  }
}

TEST(TextureTiff, ReadsPalettes) {
  const Samples samples = pattern(9, 5, 1);
  TiffKind kind{.meaning = PHOTOMETRIC_PALETTE};
  for (int i = 0; i < 768; ++i)
    kind.palette.push_back(static_cast<std::uint16_t>(i * 7 % 256 * 257));
  expectTexels(decoded(tiffOf(samples, kind)), 9, 5, [&](auto x, auto y) {
    const auto index = static_cast<std::size_t>(std::lround(samples.share(x, y, 0) * 255));
    const auto light = [&](std::size_t i) {
      return srgbToLinear(kind.palette[256 * i + index] / 65535.0);
    };
    return Colour{light(0), light(1), light(2), 1};
  });
}

TEST(TextureTiff, ReadsInks) {
  const Samples samples = pattern(9, 5, 4);
  expectTexels(
      decoded(tiffOf(samples, {.meaning = PHOTOMETRIC_SEPARATED})), 9, 5,
      [&](auto x, auto y) {
        const auto light = [&](int i) {
          return srgbToLinear((1 - samples.share(x, y, i)) * (1 - samples.share(x, y, 3)));
        };
        return Colour{light(0), light(1), light(2), 1};
      },
      0.01);
}

TEST(TextureTiff, TurnsTheImageAsItsTagSays) {
  const Samples samples = pattern(5, 3, 3);
  const Texture plain = decoded(tiffOf(samples, {}));
  const auto at = [&](int column, int row) {
    return plain.texels[static_cast<std::size_t>(row * 5 + column)];
  };
  using Place = std::function<Texture::Texel(int x, int y)>;
  const std::vector<std::pair<std::uint16_t, Place>> cases{
      {ORIENTATION_TOPRIGHT, [&](int x, int y) { return at(4 - x, y); }},
      {ORIENTATION_BOTRIGHT, [&](int x, int y) { return at(4 - x, 2 - y); }},
      {ORIENTATION_BOTLEFT, [&](int x, int y) { return at(x, 2 - y); }},
      {ORIENTATION_LEFTTOP, [&](int x, int y) { return at(y, x); }},
      {ORIENTATION_RIGHTTOP, [&](int x, int y) { return at(y, 2 - x); }},
      {ORIENTATION_RIGHTBOT, [&](int x, int y) { return at(4 - y, 2 - x); }},
      {ORIENTATION_LEFTBOT, [&](int x, int y) { return at(4 - y, x); }}};
  for (const auto& [orientation, place] : cases) {
    const Texture texture = decoded(tiffOf(samples, {.orientation = orientation}));
    const bool is_turned = orientation >= ORIENTATION_LEFTTOP;
    ASSERT_EQ(texture.width, is_turned ? 3U : 5U);
    ASSERT_EQ(texture.height, is_turned ? 5U : 3U);
    for (int y = 0; y < static_cast<int>(texture.height); ++y) {
      for (int x = 0; x < static_cast<int>(texture.width); ++x) {
        EXPECT_EQ(
            texture
                .texels[static_cast<std::size_t>(y) * texture.width + static_cast<std::size_t>(x)],
            place(x, y))
            << orientation << " at " << x << ", " << y;
      }
    }
  }
}

TEST(TextureTiff, HonoursProfiles) {
  const Samples samples = pattern(9, 5, 3, 16);
  expectTexels(
      decoded(tiffOf(samples, {.profile = test::swappedProfile(1.8)})), 9, 5,
      [&](auto x, auto y) {
        const auto light = [&](int i) { return std::pow(samples.share(x, y, i), 1.8); };
        return Colour{light(2), light(0), light(1), 1};
      },
      2e-4);
  EXPECT_EQ(decoded(tiffOf(samples, {.profile = Bytes(200, 0x77)})).texels,
            decoded(tiffOf(samples, {})).texels);
}

TEST(TextureTiff, RefusesMoreRowsThanItsBytesHold) {
  TiffKind kind{.meaning = PHOTOMETRIC_PALETTE, .rows = 5};
  kind.palette.resize(768);
  Bytes bytes = tiffOf(pattern(9, 5, 1), kind);
  EXPECT_EQ(decoded(bytes).height, 5U);
  // ImageLength, as a long.
  const Bytes tag{0x01, 0x01, 0x03, 0, 1, 0, 0, 0, 5, 0};
  const auto at = std::search(bytes.begin(), bytes.end(), tag.begin(), tag.end());
  ASSERT_NE(at, bytes.end());
  const Bytes longer{0x01, 0x01, 0x04, 0, 1, 0, 0, 0, 0, 0, 16, 0};
  std::copy(longer.begin(), longer.end(), at);
  EXPECT_EQ(test::textureRefusal(bytes),
            "texture 'a' is not a readable TIFF: it is damaged or cut short; save it again");
}

TEST(TextureTiff, RefusesWhatIsDamagedOrOfOtherKinds) {
  const Samples samples = pattern(19, 11, 3);
  for (const std::uint32_t tile : {0, 16}) {
    const Bytes bytes = tiffOf(samples, {.tile = tile});
    test::expectPrefixesAreRefused(bytes, true);
    test::expectSpoiltImagesAreReadOrRefused(bytes);
    EXPECT_EQ(test::textureRefusal({bytes.begin(), bytes.begin() + 200}),
              "texture 'a' is not a readable TIFF: it is damaged or cut short; save it again");
  }
  test::expectSpoiltImagesAreReadOrRefused(
      tiffOf(pattern(19, 11, 4, 16), {.packing = COMPRESSION_ADOBE_DEFLATE,
                                      .planes = PLANARCONFIG_SEPARATE,
                                      .profile = test::swappedProfile(1.8)}));
  EXPECT_EQ(test::textureRefusal(tiffOf(pattern(5, 3, 17), {})),
            "texture 'a' is a TIFF of too many samples a pixel; save it as RGB");
  EXPECT_EQ(test::textureRefusal(tiffOf(pattern(5, 3, 1), {.meaning = PHOTOMETRIC_MASK})),
            "texture 'a' is a TIFF of a kind that is not read; save it as RGB of 8 or 16 bits");
}

}  // namespace
}  // namespace vdbdither
