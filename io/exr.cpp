#include "io/exr.h"

#include <algorithm>

#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfIO.h>
#include <ImfOutputFile.h>

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

}  // namespace

std::vector<std::uint8_t> encodeExr(std::uint32_t width, std::uint32_t height, double pixel_aspect,
                                    std::span<const ExrChannel> channels, const ExrRow& fill) {
  Imf::Header header(static_cast<int>(width), static_cast<int>(height),
                     static_cast<float>(pixel_aspect));
  header.compression() = Imf::ZIPS_COMPRESSION;
  // One row at a time passes through these, so the rows of the frame buffer all lie in the same
  // place.
  std::vector<std::vector<float>> singles(channels.size(), std::vector<float>(width));
  std::vector<std::vector<half>> halves(channels.size());
  Imf::FrameBuffer buffer;
  for (std::size_t i = 0; i < channels.size(); ++i) {
    const ExrChannel& channel = channels[i];
    const Imf::PixelType type = channel.half ? Imf::HALF : Imf::FLOAT;
    header.channels().insert(channel.name, Imf::Channel(type));
    if (channel.half) halves[i].resize(width);
    buffer.insert(
        channel.name,
        channel.half
            ? Imf::Slice(type, reinterpret_cast<char*>(halves[i].data()), sizeof(half), 0)
            : Imf::Slice(type, reinterpret_cast<char*>(singles[i].data()), sizeof(float), 0));
  }
  std::vector<std::uint8_t> bytes;
  MemoryStream stream(bytes);
  {
    Imf::OutputFile file(stream, header, 0);
    file.setFrameBuffer(buffer);
    for (std::uint32_t row = 0; row < height; ++row) {
      for (std::size_t i = 0; i < channels.size(); ++i) {
        fill(row, i, singles[i]);
        std::copy_n(singles[i].begin(), halves[i].size(), halves[i].begin());
      }
      file.writePixels(1);
    }
  }
  return bytes;
}

}  // namespace vdbdither
