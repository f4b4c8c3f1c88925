// Feeds the reader of plain PNG with packed rows and with whole files that a fuzzer thinks of: what
// it accepts, zlib and libpng read alike. A unit is a PNG, whose checksums are mended, or kind,
// width, height and a deflate stream, which become one.

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>
#include <zlib.h>

#include "io/image/colour_image.h"
#include "io/image/plain_png.h"
#include "io/image/row_inflater.h"
#include "tests/fuzz/png_parts.h"
#include "tests/fuzz/sound_slice.h"

namespace vdbdither {

namespace {

struct Unpacked {
  std::vector<std::uint8_t> bytes;
  std::size_t read = 0;  ///< of the stream; 0 where it is damaged or does not end
};

/// What zlib makes of a deflate stream, or as much of it as there is room for.
Unpacked unpackedByZlib(std::span<const std::uint8_t> stream, std::size_t most) {
  Unpacked unpacked{std::vector<std::uint8_t>(most + 1), 0};
  z_stream zlib{};
  require(inflateInit2(&zlib, -MAX_WBITS) == Z_OK);
  zlib.next_in = const_cast<Bytef*>(stream.data());
  zlib.avail_in = static_cast<uInt>(stream.size());
  zlib.next_out = unpacked.bytes.data();
  zlib.avail_out = static_cast<uInt>(unpacked.bytes.size());
  if (inflate(&zlib, Z_FINISH) == Z_STREAM_END) unpacked.read = zlib.total_in;
  unpacked.bytes.resize(zlib.total_out);
  inflateEnd(&zlib);
  return unpacked;
}

/// Requires that the reader of plain PNG and libpng agree. The latter reads what has a chunk that
/// the former does not know.
void compareReaders(std::span<const std::uint8_t> png) {
  const auto plain = decodedOrRefused(
      [&](const SizeCheck& check) { return decodePlainPng(mendedPng(png), check); });
  const auto other = decodedOrRefused(
      [&](const SizeCheck& check) { return decodePngImage(mendedPng(png, true), check); });
  if (other) requireSound(other->pixels);
  if (!plain || !*plain) return;
  requireSound((*plain)->pixels);
  require(other.has_value());
  require((*plain)->pixels == other->pixels);
  require((*plain)->is_grey == other->is_grey && (*plain)->has_opacity == other->has_opacity &&
          (*plain)->is_rgba8 == other->is_rgba8);
}

void comparePacked(std::span<const std::uint8_t> unit) {
  struct Kind {
    std::uint8_t depth, kind;
  };
  static constexpr std::array<Kind, 3> kinds{{{8, 6}, {8, 0}, {1, 0}}};
  const Kind kind = kinds.at(unit[0] % kinds.size());
  const std::uint32_t width = unit[1] + 1U;
  const std::uint32_t height = unit[2] + 1U;
  const auto stream = unit.subspan(3);
  const std::size_t stride = 1 + (kind.kind == 6 ? 4 * width : (width * kind.depth + 7) / 8);
  std::vector<std::uint8_t> rows;
  const std::size_t read = RowInflater(stride, height).run(stream, [&](auto row) {
    require(row.size() == stride);
    rows.insert(rows.end(), row.begin(), row.end());
    return true;
  });
  const Unpacked expected = unpackedByZlib(stream, stride * height);
  if (read > 0) {
    require(rows == expected.bytes);
    require(read == expected.read);
  }
  std::vector<std::uint8_t> png(png_signature.begin(), png_signature.end());
  std::vector<std::uint8_t> header;
  putBigEndian(header, width);
  putBigEndian(header, height);
  header.insert(header.end(), {kind.depth, kind.kind, 0, 0, 0});
  putChunk(png, "IHDR", header);
  std::vector<std::uint8_t> data{0x78, 0x9c};
  data.insert(data.end(), stream.begin(), stream.end());
  if (expected.read > 0) data.resize(2 + expected.read);
  putBigEndian(
      data, static_cast<std::uint32_t>(adler32_z(1, expected.bytes.data(), expected.bytes.size())));
  putChunk(png, "IDAT", data);
  putChunk(png, "IEND", {});
  compareReaders(png);
}

}  // namespace

}  // namespace vdbdither

// NOLINTNEXTLINE(readability-identifier-naming): the fuzzer calls it so
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size > 0 && data[0] == 0x89) {
    vdbdither::compareReaders({data, size});
  } else if (size > 3) {
    vdbdither::comparePacked({data, size});
  }
  return 0;
}
