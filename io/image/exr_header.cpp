// OpenEXR: the OpenEXR file layout (Academy Software Foundation, version 2).

#include "io/image/exr_header.h"

#include <algorithm>
#include <span>

#include <ImfChannelList.h>
#include <ImfTileDescriptionAttribute.h>

#include "io/file/little_endian.h"
#include "vdbdither/model/errors.h"

namespace vdbdither {

namespace {

using Bytes = std::span<const std::uint8_t>;

constexpr std::size_t header_begin = 8;
constexpr int deep_flag = 0x800;
constexpr int multi_part_flag = 0x1000;

int numberAt(Bytes bytes, std::size_t at) {
  if (at + 4 > bytes.size()) throw DataError("is not a readable EXR: it is cut short");
  return static_cast<int>(littleEndian(bytes.subspan(at), 4));
}

/// Where the text at `at` ends, behind its zero.
std::size_t afterText(Bytes bytes, std::size_t at) {
  while (at < bytes.size() && bytes[at] != 0) ++at;
  return at + 1;
}

/// OpenEXR takes the memory that an attribute claims before it reads it.
void checkAttributes(Bytes bytes, bool has_parts) {
  std::size_t at = header_begin;
  for (bool is_first = true; is_first || has_parts; is_first = false) {
    if (at < bytes.size() && bytes[at] == 0) return;
    while (at < bytes.size() && bytes[at] != 0) {
      at = afterText(bytes, afterText(bytes, at));
      const int size = numberAt(bytes, at);
      at += 4;
      if (size < 0 || at > bytes.size() || static_cast<std::size_t>(size) > bytes.size() - at)
        throw DataError("is not a readable EXR: it is cut short");
      at += static_cast<std::size_t>(size);
    }
    if (at >= bytes.size()) throw DataError("is not a readable EXR: it is cut short");
    ++at;
  }
}

std::uint64_t rowsOfChunk(Imf::Compression compression) {
  switch (compression) {
    case Imf::ZIP_COMPRESSION:
    case Imf::PXR24_COMPRESSION:
      return 16;
    case Imf::PIZ_COMPRESSION:
    case Imf::B44_COMPRESSION:
    case Imf::B44A_COMPRESSION:
    case Imf::DWAA_COMPRESSION:
      return 32;
    case Imf::DWAB_COMPRESSION:
      return 256;
    default:
      return 1;
  }
}

}  // namespace

Imf::Header readExrHeader(ExrSource& source) {
  int version = numberAt(source.bytes(), 4);
  if ((version & deep_flag) != 0) throw DataError("is a deep EXR; save it flat");
  checkAttributes(source.bytes(), (version & multi_part_flag) != 0);
  Imf::Header header;
  source.seekg(header_begin);
  header.readFrom(source, version);
  source.seekg(0);
  return header;
}

ExrSize exrSizeOf(const Imf::Header& header) {
  const Imath::Box2i& window = header.dataWindow();
  if (window.isEmpty()) throw DataError("has no pixels; save it again");
  const auto extent = [](int low, int high) {
    return static_cast<std::uint32_t>(std::int64_t{high} - low + 1);
  };
  return {extent(window.min.x, window.max.x), extent(window.min.y, window.max.y)};
}

std::uint64_t exrPixelBytes(const Imf::Header& header) {
  std::uint64_t bytes = 0;
  for (auto channel = header.channels().begin(); channel != header.channels().end(); ++channel)
    bytes += channel.channel().type == Imf::HALF ? 2 : 4;
  return bytes;
}

void checkExrChunks(const Imf::Header& header, std::size_t file_bytes,
                    std::uint64_t most_held_pixels) {
  const auto [width, height] = exrSizeOf(header);
  std::uint64_t chunk_width = width;
  std::uint64_t chunk_height = rowsOfChunk(header.compression());
  std::uint64_t held_rows = chunk_height;
  if (header.hasTileDescription()) {
    chunk_width = std::max(header.tileDescription().xSize, 1U);
    chunk_height = std::max(header.tileDescription().ySize, 1U);
    held_rows = std::min<std::uint64_t>(chunk_height, height);
  }
  constexpr std::uint64_t most_held_bytes = std::uint64_t{1} << 28;
  constexpr std::uint64_t most_tile_edge = 4096;
  if (chunk_width > std::max<std::uint64_t>(width, most_tile_edge) ||
      chunk_height > most_tile_edge ||
      exrPixelBytes(header) > most_held_bytes / (chunk_width * chunk_height) ||
      held_rows * width > most_held_pixels)
    throw DataError(
        "is an EXR of too many channels, or of tiles that are too large; save it again "
        "with its colours alone");
  // Every chunk has eight bytes in a table.
  const std::uint64_t chunks =
      ((width + chunk_width - 1) / chunk_width) * ((height + chunk_height - 1) / chunk_height);
  if (chunks > file_bytes / 8) throw DataError("is not a readable EXR: it is cut short");
}

}  // namespace vdbdither
