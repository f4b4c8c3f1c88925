#include "io/image/plain_png.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <random>
#include <string>
#include <vector>
#include <zlib.h>

#include <gtest/gtest.h>

#include "io/image/png_spans.h"
#include "tests/support/png_reader.h"
#include "tests/support/span_images.h"
#include "vdbdither/model/errors.h"

namespace vdbdither {
namespace {

using Bytes = std::vector<std::uint8_t>;

void append(Bytes& bytes, std::uint32_t value) {
  for (int shift = 24; shift >= 0; shift -= 8)
    bytes.push_back(static_cast<std::uint8_t>(value >> shift));
}

void appendChunk(Bytes& file, const std::string& type, const Bytes& data) {
  append(file, static_cast<std::uint32_t>(data.size()));
  const std::size_t begin = file.size();
  file.insert(file.end(), type.begin(), type.end());
  file.insert(file.end(), data.begin(), data.end());
  append(file, static_cast<std::uint32_t>(
                   crc32(0, file.data() + begin, static_cast<uInt>(file.size() - begin))));
}

Bytes deflated(const Bytes& data, int level, int strategy) {
  z_stream stream{};
  EXPECT_EQ(deflateInit2(&stream, level, Z_DEFLATED, 15, 8, strategy), Z_OK);
  Bytes packed(deflateBound(&stream, data.size()) + 64);
  stream.next_in = const_cast<Bytef*>(data.data());
  stream.avail_in = static_cast<uInt>(data.size());
  stream.next_out = packed.data();
  stream.avail_out = static_cast<uInt>(packed.size());
  EXPECT_EQ(deflate(&stream, Z_FINISH), Z_STREAM_END);
  packed.resize(stream.total_out);
  deflateEnd(&stream);
  return packed;
}

/// A PNG whose rows are bytes as they are stored, filter bytes included.
Bytes pngOf(int width, int height, int depth, int kind, const Bytes& packed, std::size_t piece) {
  Bytes file{0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n'};
  Bytes header;
  append(header, static_cast<std::uint32_t>(width));
  append(header, static_cast<std::uint32_t>(height));
  header.insert(header.end(),
                {static_cast<std::uint8_t>(depth), static_cast<std::uint8_t>(kind), 0, 0, 0});
  appendChunk(file, "IHDR", header);
  for (std::size_t at = 0; at < packed.size(); at += piece) {
    const auto begin = packed.begin() + static_cast<std::ptrdiff_t>(at);
    appendChunk(
        file, "IDAT",
        Bytes(begin, begin + static_cast<std::ptrdiff_t>(std::min(piece, packed.size() - at))));
  }
  appendChunk(file, "IEND", {});
  return file;
}

/// The same by libpng.
SpanImage expected(const Bytes& file) {
  const test::PngImage png = test::readPng(file);
  const std::size_t stride = png.rows.size() / png.height;
  SpansBuilder spans(png.width);
  for (std::uint32_t y = 0; y < png.height; ++y) {
    const std::uint8_t* row = png.rows.data() + y * stride;
    for (std::uint32_t x = 0; x < png.width; ++x) {
      std::uint32_t colour = 0;
      if (png.colour_type == 6) {
        std::memcpy(&colour, row + std::size_t{4} * x, 4);
      } else {
        const int level = png.bit_depth == 8 ? row[x] : (row[x / 8] >> (7 - x % 8) & 1) * 255;
        const auto grey = static_cast<std::uint8_t>(level);
        colour = rgba(grey, grey, grey);
      }
      spans.pixel(x, colour);
    }
    spans.endRow();
  }
  return spans.finish();
}

struct Kind {
  int depth, kind, bytes_of_8;  ///< of eight pixels
};
constexpr std::array<Kind, 3> kinds{{{8, 6, 32}, {8, 0, 8}, {1, 0, 1}}};

/// Rows of runs, some with filters.
Bytes rowsOf(int width, int height, const Kind& kind, bool is_filtered, std::mt19937& random) {
  const std::size_t size = (static_cast<std::size_t>(width) * kind.bytes_of_8 + 7) / 8;
  const std::size_t unit = kind.kind == 6 ? 4 : 1;
  Bytes rows;
  for (int y = 0; y < height; ++y) {
    rows.push_back(static_cast<std::uint8_t>(is_filtered && random() % 3 ? random() % 5 : 0));
    std::array<std::uint8_t, 4> value{};
    std::size_t left = 0;
    for (std::size_t i = 0; i < size; ++i) {
      if (i % unit == 0 && left-- == 0) {
        for (std::uint8_t& byte : value) byte = static_cast<std::uint8_t>(random() % 3 * 127);
        left = random() % 4 ? random() % 5 : random() % 2000;
      }
      rows.push_back(value[i % unit]);
    }
  }
  return rows;
}

TEST(PlainPng, ReadsWhatLibpngReads) {
  std::mt19937 random(3);
  for (const Kind& kind : kinds) {
    for (const auto& [width, height] :
         {std::pair(1, 1), {7, 3}, {64, 9}, {333, 50}, {9001, 12}, {70001, 3}}) {
      for (const auto& [level, strategy] : {std::pair(0, Z_DEFAULT_STRATEGY),
                                            {1, Z_DEFAULT_STRATEGY},
                                            {9, Z_DEFAULT_STRATEGY},
                                            {6, Z_FIXED},
                                            {6, Z_HUFFMAN_ONLY},
                                            {6, Z_RLE},
                                            {6, Z_FILTERED}}) {
        for (const bool is_filtered : {false, true}) {
          const Bytes rows = rowsOf(width, height, kind, is_filtered, random);
          const Bytes file = pngOf(width, height, kind.depth, kind.kind,
                                   deflated(rows, level, strategy), random() % 2 ? 997 : 1 << 30);
          SCOPED_TRACE(testing::Message() << "kind " << kind.kind << " of " << kind.depth << ", "
                                          << width << " x " << height << ", level " << level
                                          << ", strategy " << strategy << ", " << is_filtered);
          const auto image = decodePlainPng(file, {});
          ASSERT_TRUE(image);
          EXPECT_EQ(image->pixels, expected(file));
          EXPECT_EQ(image->is_grey, kind.kind == 0);
          EXPECT_EQ(image->is_rgba8, kind.kind == 6);
        }
      }
    }
  }
}

TEST(PlainPng, ReadsTheSlicesOfThisProgram) {
  const std::vector<std::uint32_t> palette = {rgba(0, 0, 0), rgba(240, 240, 240)};
  for (const int width : {40, 900}) {
    const SpanImage disc = test::ditheredDisc(width, width / 2, width / 6.0, 5);
    for (const PngPixels pixels : {PngPixels::rgba8, PngPixels::grey8, PngPixels::grey1}) {
      const Bytes file = encodePng(disc, {pixels, palette, 0.04, 0.08});
      const auto image = decodePlainPng(file, {});
      ASSERT_TRUE(image);
      EXPECT_EQ(image->pixels, expected(file));
    }
  }
}

TEST(PlainPng, WhatIsDamagedIsNotRead) {
  const SpanImage disc = test::ditheredDisc(30, 20, 8, 5);
  const std::vector<std::uint32_t> palette = {0, 1};
  const Bytes file = encodePng(disc, {PngPixels::grey1, palette, 0.1, 0.1});
  for (std::size_t bit = 0; bit < 8 * (file.size() - 12); ++bit) {
    Bytes damaged = file;
    damaged[bit / 8] ^= 1 << bit % 8;
    EXPECT_FALSE(decodePlainPng(damaged, {})) << "bit " << bit;
  }
  for (std::size_t size = 0; size < file.size(); ++size)
    EXPECT_FALSE(decodePlainPng(std::span(file).first(size), {})) << size << " bytes";
}

/// Damage that no checksum of a chunk tells. That of the stream is weak, so zlib is the judge.
TEST(PlainPng, ReadsADamagedStreamWhereZlibDoes) {
  std::mt19937 random(9);
  const Bytes rows = rowsOf(50, 20, kinds[0], false, random);
  const Bytes packed = deflated(rows, 9, Z_DEFAULT_STRATEGY);
  std::size_t refused = 0;
  for (std::size_t bit = 0; bit < 8 * packed.size(); ++bit) {
    Bytes damaged = packed;
    damaged[bit / 8] ^= 1 << bit % 8;
    Bytes unpacked(rows.size());
    uLongf size = unpacked.size();
    const bool is_sound =
        uncompress(unpacked.data(), &size, damaged.data(), damaged.size()) == Z_OK &&
        size == rows.size();
    const auto image = decodePlainPng(pngOf(50, 20, 8, 6, damaged, 1 << 30), {});
    ASSERT_EQ(image.has_value(), is_sound) << "bit " << bit;
    if (is_sound) {
      EXPECT_EQ(image->pixels,
                expected(pngOf(50, 20, 8, 6, deflated(unpacked, 1, Z_FIXED), 1 << 30)))
          << "bit " << bit;
    }
    refused += is_sound ? 0 : 1;
  }
  EXPECT_GT(refused, 7 * packed.size());
  for (std::size_t size = 0; size < packed.size(); ++size) {
    const Bytes part(packed.begin(), packed.begin() + static_cast<std::ptrdiff_t>(size));
    EXPECT_FALSE(decodePlainPng(pngOf(50, 20, 8, 6, part, 1 << 30), {})) << size << " bytes";
  }
  for (const int height : {19, 21})
    EXPECT_FALSE(decodePlainPng(pngOf(50, height, 8, 6, packed, 1 << 30), {})) << height << " rows";
}

TEST(PlainPng, TheSizeIsCheckedBeforeThePixels) {
  const Bytes file = pngOf(60000, 60000, 1, 0, {1}, 1 << 30);
  EXPECT_THROW(decodePlainPng(file, [](std::uint32_t, std::uint32_t) { throw DataError("large"); }),
               DataError);
}

}  // namespace
}  // namespace vdbdither
