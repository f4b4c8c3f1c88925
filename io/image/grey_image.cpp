#include "io/image/grey_image.h"

#include <cmath>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfInputFile.h>
#include <png.h>

#include "io/file/whole_file.h"
#include "io/image/exr_header.h"
#include "io/image/exr_source.h"
#include "io/image/png_source.h"
#include "io/image/texture.h"
#include "vdbdither/model/errors.h"

namespace vdbdither {

namespace {

/// A height map beyond this is a mistake.
constexpr std::uint64_t greatest_edge = 1 << 16;

/// Checks the size before memory is taken for the pixels.
void checkSize(std::uint64_t width, std::uint64_t height) {
  if (width > greatest_edge || height > greatest_edge || width * height > most_texels) {
    throw DataError("has " + std::to_string(width) + " x " + std::to_string(height) +
                    " pixels; at most " + std::to_string(most_texels) +
                    " are read, and 65536 in a row or column; scale it down");
  }
}

GreyImage readPng(std::span<const std::uint8_t> bytes) {
  PngSource source(bytes);
  png_structp png = source.png();
  png_infop info = source.info();
  png_read_info(png, info);
  const std::uint32_t width = png_get_image_width(png, info);
  const std::uint32_t height = png_get_image_height(png, info);
  if ((png_get_color_type(png, info) & PNG_COLOR_MASK_COLOR) != 0)
    throw DataError("is in colour; a height map is grey");
  checkSize(width, height);
  if (png_get_bit_depth(png, info) < 8) png_set_expand_gray_1_2_4_to_8(png);
  png_set_expand_16(png);
  png_set_strip_alpha(png);
  png_set_interlace_handling(png);
  png_read_update_info(png, info);
  const std::size_t stride = png_get_rowbytes(png, info);
  std::vector<std::uint8_t> samples(stride * height);
  std::vector<png_bytep> rows;
  for (std::uint32_t y = 0; y < height; ++y) rows.push_back(samples.data() + stride * y);
  png_read_image(png, rows.data());
  png_read_end(png, nullptr);
  GreyImage image{static_cast<int>(width), static_cast<int>(height), {}};
  image.values.reserve(std::size_t{width} * height);
  const auto pixel_bytes = std::size_t{2} * png_get_channels(png, info);
  for (std::size_t at = 0; at + 1 < samples.size(); at += pixel_bytes)
    image.values.push_back(static_cast<float>((samples[at] << 8 | samples[at + 1]) / 65535.0));
  return image;
}

GreyImage readExr(std::span<const std::uint8_t> bytes) {
  return readingExr([&] {
    ExrSource source(bytes);
    const Imf::Header header = readExrHeader(source);
    const Imf::ChannelList& channels = header.channels();
    std::string name;
    int count = 0;
    for (auto channel = channels.begin(); channel != channels.end(); ++channel, ++count)
      name = channel.name();
    if (channels.findChannel("Y")) {
      name = "Y";
    } else if (count != 1) {
      throw DataError("has several channels and none is called Y");
    }
    const ExrSize size = exrSizeOf(header);
    checkSize(size.width, size.height);
    checkExrChunks(header, bytes.size());
    Imf::InputFile file(source, 0);
    const Imath::Box2i window = file.header().dataWindow();
    if (window != header.dataWindow()) throw DataError("is not a readable EXR: it is damaged");
    GreyImage image{static_cast<int>(size.width), static_cast<int>(size.height), {}};
    image.values.resize(std::size_t{size.width} * size.height);
    Imf::FrameBuffer buffer;
    const auto stride = sizeof(float) * std::size_t{size.width};
    buffer.insert(name,
                  Imf::Slice::Make(Imf::FLOAT, image.values.data(), window, sizeof(float), stride));
    file.setFrameBuffer(buffer);
    file.readPixels(window.min.y, window.max.y);
    return image;
  });
}

}  // namespace

GreyImage readGreyImage(const std::filesystem::path& path) {
  const std::string shown = "'" + path.string() + "'";
  if (!std::filesystem::is_regular_file(path)) throw UsageError("no such file " + shown);
  constexpr std::uint64_t most_bytes = std::uint64_t{1} << 32;
  const std::vector<std::uint8_t> bytes = readWholeFile(path, shown, most_bytes);
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  const bool is_png = text.starts_with("\x89PNG");
  if (!is_png && !text.starts_with("\x76\x2f\x31\x01"))
    throw DataError(shown + " is neither a PNG nor an OpenEXR file");
  try {
    GreyImage image = is_png ? readPng(bytes) : readExr(bytes);
    for (const float value : image.values) {
      if (!std::isfinite(value)) throw DataError("holds values that are not finite numbers");
    }
    return image;
  } catch (const DataError& error) {
    throw DataError(shown + " is no height map: it " + error.what());
  }
}

}  // namespace vdbdither
