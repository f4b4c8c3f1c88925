// PNG: Portable Network Graphics Specification, third edition (W3C, 2025).

#include <array>
#include <bit>
#include <string>
#include <vector>

#include "io/image/png_source.h"
#include "io/image/texture_builder.h"
#include "vdbdither/model/errors.h"

namespace vdbdither {

namespace {

/// Deflate packs 258 bytes into two bits at best, so this is what a byte can become.
constexpr std::uint64_t deflate_ratio = 1032;

ColourSpace pngColourSpace(png_structp png, png_infop info) {
  ColourSpace space;
  int intent = 0;
  if (png_get_sRGB(png, info, &intent) != 0) return space;
  png_charp name = nullptr;
  int packing = 0;
  png_bytep profile = nullptr;
  png_uint_32 size = 0;
  if (png_get_iCCP(png, info, &name, &packing, &profile, &size) != 0) {
    space.icc_profile.assign(profile, profile + size);
    return space;
  }
  double exponent = 0;
  if (png_get_gAMA(png, info, &exponent) != 0 && exponent > 0.01 && exponent < 100)
    space.exponent = 1 / exponent;
  ColourSpace::Chromaticities xy{};
  if (png_get_cHRM(png, info, &xy[3][0], &xy[3][1], &xy[0][0], &xy[0][1], &xy[1][0], &xy[1][1],
                   &xy[2][0], &xy[2][1]) != 0)
    space.chromaticities = xy;
  return space;
}

/// Expands palettes, transparent colours and fewer than 8 bits.
SampleLayout expandPng(png_structp png, png_infop info) {
  png_set_expand(png);
  if (png_get_bit_depth(png, info) == 16 && std::endian::native == std::endian::little)
    png_set_swap(png);
  png_set_interlace_handling(png);
  png_read_update_info(png, info);
  const int kind = png_get_color_type(png, info);
  SampleLayout layout;
  layout.colours = (kind & PNG_COLOR_MASK_COLOR) != 0 ? 3 : 1;
  if ((kind & PNG_COLOR_MASK_ALPHA) != 0) layout.opacity = SampleLayout::Opacity::straight;
  if (png_get_bit_depth(png, info) == 16) layout.type = SampleLayout::Type::word;
  return layout;
}

}  // namespace

Texture decodePngTexture(std::span<const std::uint8_t> bytes, TextureOpacity opacity) {
  PngSource source(bytes);
  png_structp png = source.png();
  png_infop info = source.info();
  // Four names with their zeros.
  constexpr std::array<png_byte, 20> wanted{'c', 'H', 'R', 'M', 0, 'g', 'A', 'M', 'A', 0,
                                            'i', 'C', 'C', 'P', 0, 's', 'R', 'G', 'B', 0};
  png_set_keep_unknown_chunks(png, PNG_HANDLE_CHUNK_AS_DEFAULT, wanted.data(), 4);
  png_read_info(png, info);
  const std::uint32_t width = png_get_image_width(png, info);
  const std::uint32_t height = png_get_image_height(png, info);
  checkTextureSize(width, height, (png_get_rowbytes(png, info) + width - 1) / width, bytes.size());
  if (png_get_rowbytes(png, info) * std::uint64_t{height} / deflate_ratio > bytes.size())
    throw DataError("is not a readable PNG: it is cut short");

  const ColourSpace space = pngColourSpace(png, info);
  const bool is_interlaced = png_get_interlace_type(png, info) != PNG_INTERLACE_NONE;
  const SampleLayout layout = expandPng(png, info);
  TextureBuilder builder(width, height, layout, space, opacity);
  const std::size_t row_bytes = png_get_rowbytes(png, info);
  // The passes of an interlaced image fill the same rows again and again.
  std::vector<std::uint8_t> rows(row_bytes * (is_interlaced ? height : 1));
  const int passes = is_interlaced ? PNG_INTERLACE_ADAM7_PASSES : 1;
  for (int pass = 1; pass <= passes; ++pass) {
    for (std::uint32_t y = 0; y < height; ++y) {
      if (pass == passes && y + 1 == height) source.allowLastRow(row_bytes);
      std::uint8_t* row = rows.data() + (is_interlaced ? y * row_bytes : 0);
      png_read_row(png, row, nullptr);
      if (pass == passes) builder.row(row);
    }
  }
  source.allowAll();
  png_read_end(png, nullptr);
  return builder.take();
}

}  // namespace vdbdither
