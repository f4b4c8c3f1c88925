#include <cmath>
#include <stdexcept>
#include <turbojpeg.h>

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

/// A JPEG of the best quality. CMYK is stored as light, as Adobe's programs do.
Bytes jpegOf(const Samples& samples, int subsampling = TJSAMP_444, int flags = 0) {
  const std::array<int, 5> formats{0, TJPF_GRAY, 0, TJPF_RGB, TJPF_CMYK};
  const tjhandle encoder = tjInitCompress();
  unsigned char* data = nullptr;
  unsigned long size = 0;
  const Bytes packed = samples.packed();
  const int failed = tjCompress2(encoder, packed.data(), static_cast<int>(samples.width), 0,
                                 static_cast<int>(samples.height),
                                 formats[static_cast<std::size_t>(samples.channels)], &data, &size,
                                 samples.channels == 1 ? TJSAMP_GRAY : subsampling, 100, flags);
  if (failed != 0) throw std::runtime_error(tjGetErrorStr2(encoder));
  Bytes bytes(data, data + size);
  tjFree(data);
  tjDestroy(encoder);
  return bytes;
}

/// An image that varies slowly, so that coding it loses next to nothing.
Samples slope(std::uint32_t width, std::uint32_t height, int channels) {
  Samples samples = pattern(width, height, channels);
  std::size_t at = 0;
  for (std::uint32_t y = 0; y < height; ++y) {
    for (std::uint32_t x = 0; x < width; ++x) {
      for (int i = 0; i < channels; ++i)
        samples.values[at++] = static_cast<std::uint16_t>(30 + 2 * x + 4 * y * (i % 2) + 20 * i);
    }
  }
  return samples;
}

constexpr double coded = 0.03;

TEST(TextureJpeg, ReadsGreyAndColoursTopRowFirst) {
  for (const int channels : {1, 3}) {
    for (const int flags : {0, TJFLAG_PROGRESSIVE}) {
      const Samples samples = slope(33, 17, channels);
      expectTexels(
          decoded(jpegOf(samples, TJSAMP_444, flags)), 33, 17,
          [&](auto x, auto y) {
            const auto light = [&](int i) {
              return srgbToLinear(samples.share(x, y, channels == 1 ? 0 : i));
            };
            return Colour{light(0), light(1), light(2), 1};
          },
          coded);
    }
  }
}

TEST(TextureJpeg, ReadsEverySubsampling) {
  const Samples samples = slope(33, 17, 3);
  for (const int subsampling : {TJSAMP_422, TJSAMP_420, TJSAMP_440, TJSAMP_411}) {
    expectTexels(
        decoded(jpegOf(samples, subsampling)), 33, 17,
        [&](auto x, auto y) {
          const auto light = [&](int i) { return srgbToLinear(samples.share(x, y, i)); };
          return Colour{light(0), light(1), light(2), 1};
        },
        0.06);
  }
}

/// Without the marker that says that inks are stored as light.
Bytes withoutAdobe(Bytes bytes) {
  for (std::size_t at = 2; at + 4 < bytes.size();) {
    const std::size_t length = static_cast<std::size_t>(bytes[at + 2] << 8 | bytes[at + 3]) + 2;
    if (bytes[at + 1] == 0xEE) {
      bytes.erase(bytes.begin() + static_cast<std::ptrdiff_t>(at),
                  bytes.begin() + static_cast<std::ptrdiff_t>(at + length));
      return bytes;
    }
    at += length;
  }
  throw std::runtime_error("no Adobe marker");
}

TEST(TextureJpeg, ReadsInks) {
  // libjpeg turns the first three of YCCK over, so that what it stores is coded well as it is.
  const Samples samples = slope(33, 17, 4);
  expectTexels(
      decoded(jpegOf(samples)), 33, 17,
      [&](auto x, auto y) {
        const auto light = [&](int i) {
          return srgbToLinear(samples.share(x, y, i) * samples.share(x, y, 3));
        };
        return Colour{light(0), light(1), light(2), 1};
      },
      coded);
}

TEST(TextureJpeg, ReadsInksThatAreStoredAsAmounts) {
  // What was luma, two centred chromas and black are the four inks without the marker.
  Samples samples = slope(33, 17, 4);
  for (std::size_t i = 0; i < samples.values.size(); i += 4)
    samples.values[i + 1] = samples.values[i + 2] = samples.values[i];
  expectTexels(
      decoded(withoutAdobe(jpegOf(samples))), 33, 17,
      [&](auto x, auto y) {
        const double light = 1 - samples.share(x, y, 3);
        const double other = srgbToLinear((1 - 128 / 255.0) * light);
        return Colour{srgbToLinear(samples.share(x, y, 0) * light), other, other, 1};
      },
      coded);
}

constexpr std::size_t none = 99;

Bytes withProfile(Bytes bytes, const Bytes& profile, std::size_t pieces, bool is_reversed,
                  std::size_t left_out) {
  Bytes segments;
  for (std::size_t i = 0; i < pieces; ++i) {
    const std::size_t piece = is_reversed ? pieces - 1 - i : i;
    if (piece == left_out) continue;
    const std::size_t begin = profile.size() * piece / pieces;
    const std::size_t end = profile.size() * (piece + 1) / pieces;
    const std::size_t length = 16 + end - begin;
    const std::string name("ICC_PROFILE\0", 12);
    segments.insert(segments.end(), {0xFF, 0xE2, static_cast<std::uint8_t>(length >> 8),
                                     static_cast<std::uint8_t>(length)});
    segments.insert(segments.end(), name.begin(), name.end());
    segments.push_back(static_cast<std::uint8_t>(piece + 1));
    segments.push_back(static_cast<std::uint8_t>(pieces));
    segments.insert(segments.end(), profile.begin() + static_cast<std::ptrdiff_t>(begin),
                    profile.begin() + static_cast<std::ptrdiff_t>(end));
  }
  bytes.insert(bytes.begin() + 2, segments.begin(), segments.end());
  return bytes;
}

TEST(TextureJpeg, HonoursProfilesInSeveralPieces) {
  const Samples samples = slope(33, 17, 3);
  const Bytes bytes = jpegOf(samples);
  const Bytes profile = test::swappedProfile(1.8);
  for (const bool is_reversed : {false, true}) {
    expectTexels(
        decoded(withProfile(bytes, profile, 3, is_reversed, none)), 33, 17,
        [&](auto x, auto y) {
          const auto light = [&](int i) { return std::pow(samples.share(x, y, i), 1.8); };
          return Colour{light(2), light(0), light(1), 1};
        },
        coded);
  }
  EXPECT_EQ(decoded(withProfile(bytes, profile, 3, false, 1)).texels, decoded(bytes).texels);
}

TEST(TextureJpeg, HonoursProfilesOfInks) {
  const Samples samples = slope(33, 17, 4);
  const Bytes profile = test::tableProfile(4);
  const std::size_t pieces = profile.size() / 60000 + 1;
  // The samples are light, that is one less the ink.
  expectTexels(
      decoded(withProfile(jpegOf(samples), profile, pieces, false, none)), 33, 17,
      [&](auto x, auto y) {
        const auto light = [&](int i) { return samples.share(x, y, i) * samples.share(x, y, 3); };
        return Colour{light(0), light(1), light(2), 1};
      },
      coded);
}

TEST(TextureJpeg, RefusesWhatIsDamagedOrCutShort) {
  // Beyond the last coded byte only the end marker is missing, which says nothing of pixels.
  const Bytes bytes = jpegOf(pattern(24, 20, 3));
  for (std::size_t size = 3; size + 2 < bytes.size(); ++size) {
    const std::string message =
        test::textureRefusal({bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(size)});
    ASSERT_THAT(message, HasSubstr("texture 'a' is not a readable JPEG: it is damaged or "))
        << size;
  }
  test::expectSpoiltImagesAreReadOrRefused(bytes);
  test::expectSpoiltImagesAreReadOrRefused(jpegOf(pattern(24, 20, 4), TJSAMP_444));
  test::expectSpoiltImagesAreReadOrRefused(
      jpegOf(pattern(24, 20, 3), TJSAMP_420, TJFLAG_PROGRESSIVE));
}

TEST(TextureJpeg, ReadsPastBytesBetweenMarkers) {
  const Samples samples = slope(33, 17, 3);
  Bytes bytes = jpegOf(samples);
  const Texture texture = decoded(bytes);
  bytes.insert(bytes.end() - 2, {1, 2, 3});
  EXPECT_EQ(decoded(bytes).texels, texture.texels);
}

TEST(TextureJpeg, RefusesScansWithoutEnd) {
  Bytes bytes = jpegOf(slope(33, 17, 3), TJSAMP_444, TJFLAG_PROGRESSIVE);
  // The last scan, again and again.
  std::size_t last = 0;
  for (std::size_t at = 2; at + 1 < bytes.size(); ++at) {
    if (bytes[at] == 0xFF && bytes[at + 1] == 0xDA) last = at;
  }
  const Bytes scan(bytes.begin() + static_cast<std::ptrdiff_t>(last), bytes.end() - 2);
  for (int i = 0; i < 100; ++i) bytes.insert(bytes.end() - 2, scan.begin(), scan.end());
  EXPECT_EQ(test::textureRefusal(bytes),
            "texture 'a' is a JPEG of more than 100 scans; save it again");
}

TEST(TextureJpeg, LimitsTheSize) {
  Bytes bytes = jpegOf(slope(33, 17, 3));
  for (std::size_t at = 2; at + 9 < bytes.size(); ++at) {
    if (bytes[at] != 0xFF || bytes[at + 1] != 0xC0) continue;
    bytes[at + 5] = bytes[at + 7] = 0xFF;
    bytes[at + 6] = bytes[at + 8] = 0;
    break;
  }
  EXPECT_EQ(test::textureRefusal(bytes),
            "texture 'a' has 65280 x 65280 pixels; at most 268435456 are read; scale it down");
}

}  // namespace
}  // namespace vdbdither
