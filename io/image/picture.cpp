#include "io/image/picture.h"

#include <fstream>
#include <iterator>
#include <string>

#include <png.h>

#include "io/image/png_decoder.h"
#include "vdbdither/model/errors.h"

namespace vdbdither {

Picture readPicture(const std::filesystem::path& path) {
  std::error_code error;
  if (!std::filesystem::exists(path, error))
    throw DataError("no such file '" + path.string() + "'");
  if (!std::filesystem::is_regular_file(path, error))
    throw DataError("'" + path.string() + "' is not a file");
  std::ifstream stream(path, std::ios::binary);
  const std::vector<char> bytes((std::istreambuf_iterator<char>(stream)), {});
  if (!stream) throw DataError("cannot read '" + path.string() + "'");
  SpanImage spans;
  try {
    spans = decodePng({reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size()});
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
