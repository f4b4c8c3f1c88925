#include "io/image/exr.h"

#include <algorithm>
#include <cmath>

#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfIO.h>
#include <ImfInputFile.h>
#include <ImfOutputFile.h>
#include <ImfTiledOutputFile.h>

#include "io/image/exr_header.h"
#include "io/image/exr_source.h"
#include "vdbdither/model/errors.h"

namespace vdbdither {

namespace {

class MemoryStream : public Imf::OStream {
 public:
  explicit MemoryStream(std::vector<std::uint8_t>& bytes) : OStream("memory"), bytes_(bytes) {}

  void write(const char data[], int size) override {
    if (position_ + size > bytes_.size()) bytes_.resize(position_ + size);
    std::copy_n(data, size, bytes_.begin() + static_cast<std::ptrdiff_t>(position_));
    position_ += size;
  }
  std::uint64_t tellp() override { return position_; }
  void seekp(std::uint64_t position) override { position_ = position; }

 private:
  std::vector<std::uint8_t>& bytes_;
  std::size_t position_ = 0;
};

Imf::Compression compressionOf(ExrPacking packing) {
  switch (packing) {
    case ExrPacking::none:
      return Imf::NO_COMPRESSION;
    case ExrPacking::rle:
      return Imf::RLE_COMPRESSION;
    case ExrPacking::zips:
      return Imf::ZIPS_COMPRESSION;
    case ExrPacking::zip:
      return Imf::ZIP_COMPRESSION;
    case ExrPacking::piz:
      return Imf::PIZ_COMPRESSION;
  }
  return Imf::ZIPS_COMPRESSION;
}

/// Some rows of every channel in the types of the file.
class Rows {
 public:
  Rows(std::uint32_t width, std::size_t rows, std::span<const ExrChannel> channels)
      : width_(width), channels_(channels), scratch_(width), values_(channels.size()) {
    for (std::size_t i = 0; i < channels.size(); ++i)
      values_[i].resize(rows * width * bytesOf(channels[i]));
  }

  void fill(std::size_t place, std::uint32_t row, const ExrRow& fill_row) {
    for (std::size_t i = 0; i < channels_.size(); ++i) {
      fill_row(row, i, scratch_);
      char* begin = values_[i].data() + place * width_ * bytesOf(channels_[i]);
      if (channels_[i].half) {
        std::copy(scratch_.begin(), scratch_.end(), reinterpret_cast<half*>(begin));
      } else {
        std::copy(scratch_.begin(), scratch_.end(), reinterpret_cast<float*>(begin));
      }
    }
  }

  /// A frame buffer in which the row `first` is the first of these; where `stretched`, every row
  /// is.
  Imf::FrameBuffer frameBuffer(std::uint32_t first, bool stretched) {
    Imf::FrameBuffer buffer;
    for (std::size_t i = 0; i < channels_.size(); ++i) {
      const std::size_t bytes = bytesOf(channels_[i]);
      const std::size_t stride = stretched ? 0 : width_ * bytes;
      buffer.insert(channels_[i].name,
                    Imf::Slice(channels_[i].half ? Imf::HALF : Imf::FLOAT,
                               values_[i].data() - first * stride, bytes, stride));
    }
    return buffer;
  }

 private:
  static std::size_t bytesOf(const ExrChannel& channel) {
    return channel.half ? sizeof(half) : sizeof(float);
  }

  std::uint32_t width_;
  std::span<const ExrChannel> channels_;
  std::vector<float> scratch_;
  std::vector<std::vector<char>> values_;
};

}  // namespace

std::vector<std::uint8_t> encodeExr(std::uint32_t width, std::uint32_t height,
                                    const ExrFormat& format, std::span<const ExrChannel> channels,
                                    const ExrRow& fill) {
  Imf::Header header(static_cast<int>(width), static_cast<int>(height),
                     static_cast<float>(format.pixel_aspect));
  header.compression() = compressionOf(format.packing);
  for (const ExrChannel& channel : channels) {
    header.channels().insert(channel.name, Imf::Channel(channel.half ? Imf::HALF : Imf::FLOAT));
  }
  std::vector<std::uint8_t> bytes;
  MemoryStream stream(bytes);
  if (format.tile == 0) {
    Rows rows(width, 1, channels);
    Imf::OutputFile file(stream, header, 0);
    file.setFrameBuffer(rows.frameBuffer(0, true));
    for (std::uint32_t row = 0; row < height; ++row) {
      rows.fill(0, row, fill);
      file.writePixels(1);
    }
  } else {
    const auto edge = static_cast<std::uint32_t>(format.tile);
    header.setTileDescription(Imf::TileDescription(edge, edge, Imf::ONE_LEVEL));
    Rows rows(width, edge, channels);
    Imf::TiledOutputFile file(stream, header, 0);
    for (int tile = 0; tile < file.numYTiles(); ++tile) {
      const std::uint32_t first = tile * edge;
      for (std::uint32_t row = first; row < std::min(height, first + edge); ++row)
        rows.fill(row - first, row, fill);
      file.setFrameBuffer(rows.frameBuffer(first, false));
      file.writeTiles(0, file.numXTiles() - 1, tile, tile);
    }
  }
  return bytes;
}

SpanImage decodeExr(std::span<const std::uint8_t> bytes, const std::string& channel,
                    const SizeCheck& check) {
  return readingExr([&] {
    ExrSource source(bytes);
    const Imf::Header header = readExrHeader(source);
    const ExrSize size = exrSizeOf(header);
    if (check) check(size.width, size.height);
    if (!header.channels().findChannel(channel))
      throw DataError("has no channel '" + channel + "'");
    checkExrChunks(header, bytes.size());
    Imf::InputFile file(source, 0);
    const Imath::Box2i window = file.header().dataWindow();
    if (window != header.dataWindow()) throw DataError("is not a readable EXR: it is damaged");
    const int width = window.max.x - window.min.x + 1;
    SpansBuilder spans(static_cast<std::uint32_t>(width));
    std::vector<float> row(static_cast<std::size_t>(width));
    for (int y = window.min.y; y <= window.max.y; ++y) {
      Imf::FrameBuffer buffer;
      buffer.insert(channel,
                    Imf::Slice(Imf::FLOAT, reinterpret_cast<char*>(row.data() - window.min.x),
                               sizeof(float), 0));
      file.setFrameBuffer(buffer);
      file.readPixels(y);
      for (int x = 0; x < width; ++x) {
        constexpr float most = 1 << 24;
        if (!(row[x] >= 0 && row[x] <= most && row[x] == std::floor(row[x]))) {
          throw DataError("holds " + std::to_string(row[x]) + " in column " + std::to_string(x) +
                          " of row " + std::to_string(y - window.min.y) +
                          ", which is not the index of a material");
        }
        spans.pixel(static_cast<std::uint32_t>(x), static_cast<std::uint32_t>(row[x]));
      }
      spans.endRow();
    }
    return spans.finish();
  });
}

}  // namespace vdbdither
