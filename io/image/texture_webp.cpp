// WebP: RFC 9649.

#include <memory>
#include <vector>
#include <webp/decode.h>
#include <webp/demux.h>

#include "io/image/texture_builder.h"
#include "vdbdither/model/errors.h"

namespace vdbdither {

namespace {

std::vector<std::uint8_t> webpProfile(std::span<const std::uint8_t> bytes) {
  const WebPData data{bytes.data(), bytes.size()};
  const std::unique_ptr<WebPDemuxer, decltype(&WebPDemuxDelete)> demuxer(WebPDemux(&data),
                                                                         WebPDemuxDelete);
  if (demuxer == nullptr || (WebPDemuxGetI(demuxer.get(), WEBP_FF_FORMAT_FLAGS) & ICCP_FLAG) == 0)
    return {};
  WebPChunkIterator chunk{};
  std::vector<std::uint8_t> profile;
  if (WebPDemuxGetChunk(demuxer.get(), "ICCP", 1, &chunk) != 0)
    profile.assign(chunk.chunk.bytes, chunk.chunk.bytes + chunk.chunk.size);
  WebPDemuxReleaseChunkIterator(&chunk);
  return profile;
}

}  // namespace

Texture decodeWebpTexture(std::span<const std::uint8_t> bytes, TextureOpacity opacity) {
  WebPBitstreamFeatures features{};
  if (WebPGetFeatures(bytes.data(), bytes.size(), &features) != VP8_STATUS_OK)
    throw DataError("is not a readable WebP: it is damaged; save it again");
  if (features.has_animation != 0) throw DataError("is an animation; save a single image");
  const auto width = static_cast<std::uint32_t>(features.width);
  const auto height = static_cast<std::uint32_t>(features.height);
  checkTextureSize(width, height, 4, bytes.size());

  SampleLayout layout;
  if (features.has_alpha != 0) layout.opacity = SampleLayout::Opacity::straight;
  const std::size_t row_bytes = width * layout.bytesPerPixel();
  std::vector<std::uint8_t> rows(row_bytes * height);
  const auto decode = features.has_alpha != 0 ? WebPDecodeRGBAInto : WebPDecodeRGBInto;
  if (decode(bytes.data(), bytes.size(), rows.data(), rows.size(), static_cast<int>(row_bytes)) ==
      nullptr)
    throw DataError("is not a readable WebP: it is damaged or cut short; save it again");

  TextureBuilder builder(width, height, layout, {webpProfile(bytes), {}, {}}, opacity);
  for (std::uint32_t y = 0; y < height; ++y) builder.row(rows.data() + y * row_bytes);
  return builder.take();
}

}  // namespace vdbdither
