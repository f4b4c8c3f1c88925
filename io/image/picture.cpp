#include "io/image/picture.h"

#include <string>

#include <png.h>

#include "io/file/whole_file.h"
#include "io/image/png_decoder.h"
#include "vdbdither/model/errors.h"

namespace vdbdither {

namespace {

/// Comparing pictures takes some hundred bytes for each pixel.
constexpr std::uint64_t most_pixels = std::uint64_t{1} << 26;
constexpr std::uint64_t most_bytes = std::uint64_t{1} << 29;

}  // namespace

Picture readPicture(const std::filesystem::path& path) {
  const std::string shown = "'" + path.string() + "'";
  std::error_code error;
  if (!std::filesystem::exists(path, error)) throw DataError("no such file " + shown);
  const std::vector<std::uint8_t> bytes = readWholeFile(path, shown, most_bytes);
  SpanImage spans;
  try {
    spans = decodePng(bytes, [](std::uint32_t width, std::uint32_t height) {
      if (std::uint64_t{width} * height > most_pixels) {
        throw DataError("has " + std::to_string(width) + " x " + std::to_string(height) +
                        " pixels; at most " + std::to_string(most_pixels) + " are read");
      }
    });
  } catch (const DataError& problem) {
    throw DataError("'" + path.string() + "' " + problem.what());
  }
  Picture picture{spans.width, spans.height, {}};
  picture.pixels.reserve(std::size_t{spans.width} * spans.height);
  for (std::uint32_t y = 0; y < spans.height; ++y) {
    for (const Span& span : spans.row(y))
      picture.pixels.resize(std::size_t{y} * spans.width + span.end, span.value);
  }
  return picture;
}

std::vector<std::uint8_t> encodePicture(const Picture& picture) {
  png_image image{};
  image.version = PNG_IMAGE_VERSION;
  image.width = picture.width;
  image.height = picture.height;
  image.format = PNG_FORMAT_RGBA;
  png_alloc_size_t size = PNG_IMAGE_PNG_SIZE_MAX(image);
  std::vector<std::uint8_t> bytes(size);
  if (png_image_write_to_memory(&image, bytes.data(), &size, 0, picture.pixels.data(), 0,
                                nullptr) == 0)
    throw DataError(std::string("the picture cannot be written: ") + image.message);
  bytes.resize(size);
  return bytes;
}

}  // namespace vdbdither
