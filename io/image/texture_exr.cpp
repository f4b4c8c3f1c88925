// OpenEXR: the OpenEXR file layout (Academy Software Foundation, version 2).

#include <array>
#include <string>
#include <vector>

#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfInputFile.h>
#include <ImfStandardAttributes.h>

#include "io/image/exr_header.h"
#include "io/image/exr_source.h"
#include "io/image/texture_builder.h"
#include "vdbdither/model/errors.h"

namespace vdbdither {

namespace {

using Bytes = std::span<const std::uint8_t>;

/// Checks the size of the picture and what it makes OpenEXR allocate.
ExrSize checkedExrSize(const Imf::Header& header, std::size_t file_bytes) {
  const ExrSize size = exrSizeOf(header);
  checkTextureSize(size.width, size.height, exrPixelBytes(header), file_bytes);
  constexpr std::uint64_t most_held_pixels = 1 << 24;
  checkExrChunks(header, file_bytes, most_held_pixels);
  return size;
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
  ExrSource source(bytes);
  const Imf::Header header = readExrHeader(source);
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
