// OpenEXR: the OpenEXR file layout (Academy Software Foundation, version 2).

#include <array>
#include <cstdlib>
#include <cstring>
#include <string>
#include <vector>

#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfInputFile.h>
#include <ImfStandardAttributes.h>
#include <ImfTileDescriptionAttribute.h>

#include "io/image/exr_source.h"
#include "io/image/texture_builder.h"
#include "vdbdither/model/errors.h"

namespace vdbdither {

namespace {

using Bytes = std::span<const std::uint8_t>;

constexpr std::size_t header_begin = 8;
constexpr int deep_flag = 0x800;
constexpr int multi_part_flag = 0x1000;

int exrNumber(Bytes bytes, std::size_t at) {
  if (at + 4 > bytes.size()) throw DataError("is not a readable EXR: it is cut short");
  std::uint32_t value = 0;
  for (std::size_t i = 0; i < 4; ++i) value |= std::uint32_t{bytes[at + i]} << 8 * i;
  return static_cast<int>(value);
}

/// Where the text at `at` ends, behind its zero.
std::size_t afterText(Bytes bytes, std::size_t at) {
  while (at < bytes.size() && bytes[at] != 0) ++at;
  return at + 1;
}

/// OpenEXR takes the memory that an attribute claims before it reads it.
void checkExrAttributes(Bytes bytes, bool has_parts) {
  std::size_t at = header_begin;
  for (bool is_first = true; is_first || has_parts; is_first = false) {
    if (at < bytes.size() && bytes[at] == 0) return;
    while (at < bytes.size() && bytes[at] != 0) {
      at = afterText(bytes, afterText(bytes, at));
      const int size = exrNumber(bytes, at);
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

struct ExrSize {
  std::uint32_t width;
  std::uint32_t height;
};

/// Checks what the header makes OpenEXR allocate.
ExrSize checkedExrSize(const Imf::Header& header, std::size_t file_bytes) {
  const Imath::Box2i& window = header.dataWindow();
  const auto extent = [](int low, int high) {
    return static_cast<std::uint64_t>(std::int64_t{high} - low + 1);
  };
  const std::uint64_t width = extent(window.min.x, window.max.x);
  const std::uint64_t height = extent(window.min.y, window.max.y);
  if (window.isEmpty()) throw DataError("has no pixels; save it again");
  std::uint64_t pixel_bytes = 0;
  for (auto channel = header.channels().begin(); channel != header.channels().end(); ++channel)
    pixel_bytes += channel.channel().type == Imf::HALF ? 2 : 4;
  checkTextureSize(width, height, pixel_bytes, file_bytes);

  std::uint64_t chunk_width = width;
  std::uint64_t chunk_height = rowsOfChunk(header.compression());
  std::uint64_t held_rows = chunk_height;
  if (header.hasTileDescription()) {
    chunk_width = std::max(header.tileDescription().xSize, 1U);
    chunk_height = std::max(header.tileDescription().ySize, 1U);
    held_rows = std::min(chunk_height, height);
  }
  constexpr std::uint64_t most_held_bytes = std::uint64_t{1} << 28;
  constexpr std::uint64_t most_tile_edge = 4096;
  constexpr std::uint64_t read_pixel_bytes = 16;
  if (chunk_width > std::max(width, most_tile_edge) || chunk_height > most_tile_edge ||
      pixel_bytes > most_held_bytes / (chunk_width * chunk_height) ||
      held_rows * width > most_held_bytes / read_pixel_bytes)
    throw DataError(
        "is an EXR of too many channels, or of tiles that are too large; save it again "
        "with its colours alone");
  // Every chunk has eight bytes in a table.
  const std::uint64_t chunks =
      ((width + chunk_width - 1) / chunk_width) * ((height + chunk_height - 1) / chunk_height);
  if (chunks > file_bytes / 8) throw DataError("is not a readable EXR: it is cut short");
  return {static_cast<std::uint32_t>(width), static_cast<std::uint32_t>(height)};
}

/// The names of the channels that are read: R, G, B or Y, and A where there is one.
std::vector<std::string> colourChannels(const Imf::ChannelList& channels) {
  const auto has = [&](const char* name) {
    const Imf::Channel* channel = channels.findChannel(name);
    return channel != nullptr && channel->xSampling == 1 && channel->ySampling == 1;
  };
  std::vector<std::string> names;
  if (has("R") && has("G") && has("B")) {
    names = {"R", "G", "B"};
  } else if (has("Y") && channels.findChannel("RY") == nullptr) {
    names = {"Y"};
  } else {
    throw DataError("is an EXR without channels R, G, B or Y alone; save it as RGB");
  }
  if (has("A")) names.emplace_back("A");
  return names;
}

ColourSpace exrColourSpace(const Imf::Header& header) {
  ColourSpace space;
  space.exponent = 1;
  if (!Imf::hasChromaticities(header)) return space;
  const Imf::Chromaticities& from = Imf::chromaticities(header);
  const Imf::Chromaticities rec709;
  if (from == rec709) return space;
  const auto position = [](const Imath::V2f& at) { return std::array<double, 2>{at.x, at.y}; };
  space.chromaticities = {position(from.red), position(from.green), position(from.blue),
                          position(from.white)};
  return space;
}

Texture readExrTexture(Bytes bytes, TextureOpacity opacity) {
  const int version = exrNumber(bytes, 4);
  if ((version & deep_flag) != 0) throw DataError("is a deep EXR; save it flat");
  checkExrAttributes(bytes, (version & multi_part_flag) != 0);
  ExrSource source(bytes);
  Imf::Header header;
  source.seekg(header_begin);
  int read_version = version;
  header.readFrom(source, read_version);
  const ExrSize size = checkedExrSize(header, bytes.size());
  const std::vector<std::string> names = colourChannels(header.channels());

  SampleLayout layout;
  layout.type = SampleLayout::Type::real;
  layout.colours = names.size() >= 3 ? 3 : 1;
  if (names.back() == "A") layout.opacity = SampleLayout::Opacity::associated;
  TextureBuilder builder(size.width, size.height, layout, exrColourSpace(header), opacity);

  source.seekg(0);
  Imf::InputFile file(source, 0);
  const Imath::Box2i& window = file.header().dataWindow();
  if (window != header.dataWindow()) throw DataError("is not a readable EXR: it is damaged");
  std::vector<float> row(size.width * names.size());
  Imf::FrameBuffer buffer;
  for (std::size_t i = 0; i < names.size(); ++i) {
    const auto stride = static_cast<std::ptrdiff_t>(names.size());
    buffer.insert(
        names[i],
        Imf::Slice(Imf::FLOAT, reinterpret_cast<char*>(row.data() + i - window.min.x * stride),
                   sizeof(float) * names.size(), 0));
  }
  file.setFrameBuffer(buffer);
  for (int y = window.min.y; y <= window.max.y; ++y) {
    file.readPixels(y);
    builder.row(reinterpret_cast<const std::uint8_t*>(row.data()));
  }
  return builder.take();
}

}  // namespace

Texture decodeExrTexture(Bytes bytes, TextureOpacity opacity) {
  return readingExr([&] { return readExrTexture(bytes, opacity); });
}

}  // namespace vdbdither
