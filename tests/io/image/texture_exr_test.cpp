#include <cmath>
#include <limits>

#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfOutputFile.h>
#include <ImfStandardAttributes.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "io/file/whole_file.h"
#include "io/image/exr.h"
#include "tests/support/scratch_folder.h"
#include "tests/support/textures.h"

namespace vdbdither {
namespace {

using test::Bytes;
using test::Colour;
using test::decoded;
using test::expectTexels;
using testing::HasSubstr;

/// Values that a half holds exactly, from below 0 to above 1.
float valueAt(std::uint32_t x, std::uint32_t y, std::size_t channel) {
  return static_cast<float>((x * 7 + y * 13 + channel * 5) % 37) / 32 - 0.0625F;
}

double clipped(double value) { return std::min(1.0, std::max(0.0, value)); }

Bytes exrOf(const std::vector<std::string>& names, bool is_half, const ExrFormat& format = {},
            std::uint32_t width = 19, std::uint32_t height = 11) {
  std::vector<ExrChannel> channels;
  channels.reserve(names.size());
  for (const std::string& name : names) channels.push_back({name, is_half});
  return encodeExr(width, height, format, channels,
                   [](std::uint32_t row, std::size_t channel, std::span<float> values) {
                     for (std::uint32_t x = 0; x < values.size(); ++x)
                       values[x] = valueAt(x, row, channel);
                   });
}

TEST(TextureExr, ReadsColoursAsLinearLight) {
  for (const bool is_half : {false, true}) {
    for (const int tile : {0, 8}) {
      for (const ExrPacking packing : {ExrPacking::none, ExrPacking::rle, ExrPacking::zips,
                                       ExrPacking::zip, ExrPacking::piz}) {
        ExrFormat format;
        format.packing = packing;
        format.tile = tile;
        expectTexels(decoded(exrOf({"R", "G", "B"}, is_half, format)), 19, 11, [](auto x, auto y) {
          return Colour{clipped(valueAt(x, y, 0)), clipped(valueAt(x, y, 1)),
                        clipped(valueAt(x, y, 2)), 1};
        });
      }
    }
  }
}

TEST(TextureExr, TakesColoursAsMultipliedByTheOpacity) {
  const Bytes bytes = exrOf({"A", "B", "G", "R"}, true);
  const auto straight = [](std::uint32_t x, std::uint32_t y) {
    const double opacity = clipped(valueAt(x, y, 0));
    const auto light = [&](std::size_t i) {
      const double value = clipped(valueAt(x, y, i));
      return opacity > 0 ? clipped(value / opacity) : value;
    };
    return Colour{light(3), light(2), light(1), opacity};
  };
  expectTexels(decoded(bytes), 19, 11, straight);
  expectTexels(decoded(bytes, TextureOpacity::ignore), 19, 11, [&](auto x, auto y) {
    Colour colour = straight(x, y);
    colour[3] = 1;
    return colour;
  });
}

TEST(TextureExr, ReadsGrey) {
  expectTexels(decoded(exrOf({"Y"}, false)), 19, 11, [](auto x, auto y) {
    const double light = clipped(valueAt(x, y, 0));
    return Colour{light, light, light, 1};
  });
}

TEST(TextureExr, CountsWhatIsNoNumberAsBlack) {
  const std::vector<ExrChannel> channels{{"Y", false}};
  const Bytes bytes = encodeExr(3, 1, {}, channels, [](auto, auto, std::span<float> values) {
    values[0] = std::numeric_limits<float>::quiet_NaN();
    values[1] = std::numeric_limits<float>::infinity();
    values[2] = -std::numeric_limits<float>::infinity();
  });
  expectTexels(decoded(bytes), 3, 1, [](auto x, auto) {
    const double light = x == 1 ? 1 : 0;
    return Colour{light, light, light, 1};
  });
}

TEST(TextureExr, HonoursPrimariesAndTheWindow) {
  const test::ScratchFolder scratch;
  Imf::Header header(Imath::Box2i({0, 0}, {99, 99}), Imath::Box2i({-3, 5}, {0, 6}));
  Imf::addChromaticities(header, Imf::Chromaticities({0.30F, 0.60F}, {0.15F, 0.06F}, {0.64F, 0.33F},
                                                     {0.3127F, 0.3290F}));
  std::vector<float> values(24);
  for (std::size_t i = 0; i < values.size(); ++i) values[i] = static_cast<float>(i) / 24;
  Imf::FrameBuffer buffer;
  for (const auto& [name, place] : {std::pair("R", 0), std::pair("G", 1), std::pair("B", 2)}) {
    header.channels().insert(name, Imf::Channel(Imf::FLOAT));
    buffer.insert(
        name,
        Imf::Slice(Imf::FLOAT, reinterpret_cast<char*>(values.data() + place + 9 - 60), 12, 48));
  }
  {
    Imf::OutputFile file((scratch / "a.exr").c_str(), header);
    file.setFrameBuffer(buffer);
    file.writePixels(2);
  }
  expectTexels(
      decoded(readWholeFile(scratch / "a.exr", "a.exr", 1 << 20)), 4, 2,
      [&](auto x, auto y) {
        const std::size_t at = (y * 4 + x) * 3;
        return Colour{values[at + 2], values[at], values[at + 1], 1};
      },
      1e-4);
}

TEST(TextureExr, RefusesOtherChannelsAndDamage) {
  EXPECT_EQ(test::textureRefusal(exrOf({"Z"}, false)),
            "texture 'a' is an EXR without channels R, G, B or Y alone; save it as RGB");
  EXPECT_EQ(test::textureRefusal(exrOf({"R", "G"}, false)),
            "texture 'a' is an EXR without channels R, G, B or Y alone; save it as RGB");
  for (const int tile : {0, 8}) {
    ExrFormat format;
    format.packing = ExrPacking::zip;
    format.tile = tile;
    const Bytes bytes = exrOf({"R", "G", "B"}, true, format);
    test::expectPrefixesAreRefused(bytes);
    test::expectSpoiltImagesAreReadOrRefused(bytes);
  }
  EXPECT_THAT(test::textureRefusal({0x76, 0x2F, 0x31, 0x01, 2, 8, 0, 0}),
              HasSubstr("texture 'a' is a deep EXR; save it flat"));
}

TEST(TextureExr, RefusesHeadersOfPartsWithoutAnEnd) {
  // The flag of several parts, and a header that ends with the file.
  for (const bool has_attribute : {false, true}) {
    Bytes bytes{0x76, 0x2F, 0x31, 0x01, 2, 0x10, 0, 0};
    if (has_attribute)
      for (const std::uint8_t byte : {'a', '\0', 'b', '\0', '\1', '\0', '\0', '\0', 'x'})
        bytes.push_back(byte);
    EXPECT_EQ(test::textureRefusal(bytes), "texture 'a' is not a readable EXR: it is cut short");
  }
}

TEST(TextureExr, RefusesWhatAHeaderOnlyClaims) {
  Bytes bytes = exrOf({"Y"}, true, {}, 16, 16);
  const std::string text = test::textOf(bytes);
  const std::size_t window = text.find("dataWindow") + 11 + 6 + 4;
  // The lower right corner of the window: 100000 x 100000, then 4096 x 4096.
  Bytes huge = bytes;
  for (const std::size_t at : {window + 8, window + 12}) {
    huge[at] = 0x9F;
    huge[at + 1] = 0x86;
    huge[at + 2] = 0x01;
  }
  EXPECT_EQ(test::textureRefusal(huge),
            "texture 'a' has 100000 x 100000 pixels; at most 268435456 are read; scale it down");
  for (const std::size_t at : {window + 8, window + 12}) {
    huge[at] = 0xFF;
    huge[at + 1] = 0x0F;
    huge[at + 2] = 0;
  }
  EXPECT_EQ(test::textureRefusal(huge), "texture 'a' is not a readable EXR: it is cut short");
  std::vector<std::string> names{"R", "G", "B"};
  for (int i = 0; i < 40; ++i) names.push_back("extra" + std::to_string(i));
  Bytes wide = exrOf(names, false, {}, 16, 16);
  const std::size_t wide_window = test::textOf(wide).find("dataWindow") + 11 + 6 + 4;
  for (const std::size_t at : {wide_window + 8, wide_window + 12}) {
    wide[at] = 0xFF;
    wide[at + 1] = 0x0F;
  }
  EXPECT_THAT(test::textureRefusal(wide), HasSubstr("texture 'a' has 4096 x 4096 pixels in "));
  // An attribute that claims 1 GB.
  const std::size_t size = text.find("compression", 8) + 12 + 12;
  bytes[size + 3] = 0x40;
  EXPECT_EQ(test::textureRefusal(bytes), "texture 'a' is not a readable EXR: it is cut short");
}

}  // namespace
}  // namespace vdbdither
