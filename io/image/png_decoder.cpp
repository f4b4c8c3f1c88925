#include "io/image/png_decoder.h"

#include <cstring>
#include <utility>
#include <vector>

#include "io/image/colour_image.h"
#include "io/image/plain_png.h"
#include "io/image/png_source.h"
#include "vdbdither/model/errors.h"

namespace vdbdither {

SpanImage decodePng(std::span<const std::uint8_t> bytes, const SizeCheck& check) {
  return decodePngImage(bytes, check).pixels;
}

ColourImage decodePngImage(std::span<const std::uint8_t> bytes, const SizeCheck& check) {
  if (auto image = decodePlainPng(bytes, check)) return *std::move(image);
  PngSource source(bytes);
  png_structp png = source.png();
  png_infop info = source.info();
  png_read_info(png, info);
  const std::uint32_t width = png_get_image_width(png, info);
  const std::uint32_t height = png_get_image_height(png, info);
  if (check) check(width, height);
  if (png_get_interlace_type(png, info) != PNG_INTERLACE_NONE)
    throw DataError("is interlaced; save it without");
  const int kind = png_get_color_type(png, info);
  const int depth = png_get_bit_depth(png, info);
  const bool has_opacity =
      (kind & PNG_COLOR_MASK_ALPHA) != 0 || png_get_valid(png, info, PNG_INFO_tRNS) != 0;
  png_set_expand(png);
  png_set_strip_16(png);
  png_set_gray_to_rgb(png);
  png_set_add_alpha(png, 255, PNG_FILLER_AFTER);
  png_read_update_info(png, info);
  SpansBuilder spans(width);
  std::vector<std::uint8_t> row(png_get_rowbytes(png, info));
  for (std::uint32_t y = 0; y < height; ++y) {
    if (y + 1 == height) source.allowLastRow(row.size());
    png_read_row(png, row.data(), nullptr);
    for (std::uint32_t x = 0; x < width; ++x) {
      std::uint32_t colour = 0;
      std::memcpy(&colour, row.data() + std::size_t{4} * x, sizeof colour);
      spans.pixel(x, colour);
    }
    spans.endRow();
  }
  source.allowAll();
  png_read_end(png, nullptr);
  return {.pixels = spans.finish(),
          .is_grey = (kind & PNG_COLOR_MASK_COLOR) == 0,
          .has_opacity = has_opacity,
          .is_rgba8 = kind == PNG_COLOR_TYPE_RGB_ALPHA && depth == 8};
}

}  // namespace vdbdither
