#include "io/image/texture.h"

#include <algorithm>
#include <array>
#include <new>
#include <span>

#include "io/file/text_bytes.h"
#include "io/image/texture_builder.h"
#include "vdbdither/model/errors.h"

namespace vdbdither {

using namespace std::string_view_literals;

namespace {

using Decode = Texture (*)(std::span<const std::uint8_t> bytes, TextureOpacity opacity);

struct Kind {
  std::size_t offset;
  std::string_view magic;
  std::string_view name;
  Decode decode;  ///< null: not read
};

constexpr std::array kinds{
    Kind{0, "\x89PNG\r\n\x1A\n"sv, "PNG", decodePngTexture},
    Kind{0, "\xFF\xD8\xFF"sv, "JPEG", decodeJpegTexture},
    Kind{8, "WEBP"sv, "WebP", decodeWebpTexture},
    Kind{0, "II*\0"sv, "TIFF", decodeTiffTexture},
    Kind{0, "MM\0*"sv, "TIFF", decodeTiffTexture},
    Kind{0, "II+\0"sv, "TIFF", decodeTiffTexture},
    Kind{0, "MM\0+"sv, "TIFF", decodeTiffTexture},
    Kind{0, "\x76\x2F\x31\x01"sv, "OpenEXR", decodeExrTexture},
    Kind{0, "\xABKTX 20\xBB"sv, "KTX2", nullptr},
    Kind{0, "\xABKTX 11\xBB"sv, "KTX", nullptr},
    Kind{0, "sB\x13\0"sv, "Basis", nullptr},
    Kind{0, "DDS "sv, "DDS", nullptr},
    Kind{0, "GIF8"sv, "GIF", nullptr},
    Kind{0, "BM"sv, "BMP", nullptr},
    Kind{0, "8BPS"sv, "PSD", nullptr},
    Kind{0, "#?RADIANCE"sv, "Radiance HDR", nullptr},
    Kind{0, "#?RGBE"sv, "Radiance HDR", nullptr},
    Kind{4, "ftypavif"sv, "AVIF", nullptr},
    Kind{4, "ftypavis"sv, "AVIF", nullptr},
    Kind{4, "ftyphei"sv, "HEIC", nullptr},
    Kind{4, "ftyphev"sv, "HEIC", nullptr},
    Kind{4, "ftypmif1"sv, "HEIF", nullptr},
    Kind{0, "\0\0\0\x0CjP  "sv, "JPEG 2000", nullptr},
    Kind{0, "\xFF\x4F\xFF\x51"sv, "JPEG 2000", nullptr},
    Kind{0, "\0\0\0\x0CJXL "sv, "JPEG XL", nullptr},
    Kind{0, "\xFF\x0A"sv, "JPEG XL", nullptr},
    Kind{0, "qoif"sv, "QOI", nullptr},
    Kind{0, "%PDF"sv, "PDF", nullptr},
    Kind{0, "<svg"sv, "SVG", nullptr},
};

constexpr std::string_view what_to_do = "; save it as PNG, JPEG, WebP, TIFF or OpenEXR";

/// An SVG may begin with a declaration, comments and white space.
bool isSvg(std::string_view bytes) {
  const std::string_view head = bytes.substr(0, 1024);
  const std::size_t begin = head.find_first_not_of("\xEF\xBB\xBF \t\r\n");
  return begin != std::string_view::npos && head[begin] == '<' &&
         head.find("<svg") != std::string_view::npos;
}

const Kind* kindOf(std::string_view bytes) {
  const auto* const found = std::find_if(kinds.begin(), kinds.end(), [&](const Kind& kind) {
    return bytes.size() > kind.offset && bytes.substr(kind.offset).starts_with(kind.magic);
  });
  return found == kinds.end() ? nullptr : found;
}

}  // namespace

Texture decodeTexture(std::string_view bytes, const std::string& shown, TextureOpacity opacity) {
  if (bytes.empty()) throw DataError(shown + " is empty; save it again");
  const Kind* kind = kindOf(bytes);
  if (kind == nullptr && isSvg(bytes))
    throw DataError(shown + " is SVG, which is not read" + std::string(what_to_do));
  if (kind == nullptr)
    throw DataError(shown + " is not an image in a format that is read" + std::string(what_to_do));
  if (kind->decode == nullptr) {
    throw DataError(shown + " is " + std::string(kind->name) + ", which is not read" +
                    std::string(what_to_do));
  }
  try {
    return kind->decode(textBytes(bytes), opacity);
  } catch (const DataError& error) {
    throw DataError(shown + " " + error.what());
  }
}

}  // namespace vdbdither
