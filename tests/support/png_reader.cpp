#include "tests/support/png_reader.h"

#include <algorithm>
#include <fstream>
#include <iterator>
#include <string>
#include <utility>

#include <gtest/gtest.h>
#include <png.h>

namespace vdbdither::test {

namespace {

void complain(png_structp png, png_const_charp text) {
  *static_cast<std::string*>(png_get_error_ptr(png)) = text;
  png_longjmp(png, 1);
}

}  // namespace

PngImage readPng(const std::vector<std::uint8_t>& bytes) {
  PngImage image;
  std::string error;
  png_structp png = png_create_read_struct(PNG_LIBPNG_VER_STRING, &error, complain, complain);
  png_infop info = png_create_info_struct(png);
  std::pair<const std::uint8_t*, std::size_t> left{bytes.data(), bytes.size()};
  std::vector<png_bytep> rows;
  if (setjmp(png_jmpbuf(png)) == 0) {
    png_set_read_fn(png, &left, [](png_structp reader, png_bytep to, std::size_t size) {
      auto& [from, rest] =
          *static_cast<std::pair<const std::uint8_t*, std::size_t>*>(png_get_io_ptr(reader));
      if (size > rest) png_error(reader, "truncated");
      std::copy_n(from, size, to);
      from += size;
      rest -= size;
    });
    png_set_crc_action(png, PNG_CRC_ERROR_QUIT, PNG_CRC_ERROR_QUIT);
    png_set_user_limits(png, 1 << 25, 1 << 25);
    png_read_info(png, info);
    image.width = png_get_image_width(png, info);
    image.height = png_get_image_height(png, info);
    image.bit_depth = png_get_bit_depth(png, info);
    image.colour_type = png_get_color_type(png, info);
    int unit = 0;
    png_get_pHYs(png, info, &image.dots_per_metre_x, &image.dots_per_metre_y, &unit);
    const std::size_t stride = png_get_rowbytes(png, info);
    image.rows.resize(stride * image.height);
    for (std::size_t y = 0; y < image.height; ++y) rows.push_back(image.rows.data() + stride * y);
    png_read_image(png, rows.data());
    png_read_end(png, nullptr);
  }
  png_destroy_read_struct(&png, &info, nullptr);
  EXPECT_EQ(error, "");
  EXPECT_EQ(left.second, 0U) << "bytes after the image";
  return image;
}

std::vector<std::uint8_t> fileBytes(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  EXPECT_TRUE(file) << path;
  return {std::istreambuf_iterator<char>(file), {}};
}

}  // namespace vdbdither::test
