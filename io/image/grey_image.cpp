#include "io/image/grey_image.h"

#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <memory>
#include <new>
#include <string>

#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfInputFile.h>
#include <png.h>

#include "vdbdither/model/errors.h"

namespace vdbdither {

namespace {

/// A height map beyond this is a mistake.
constexpr int greatest_edge = 1 << 16;

constexpr const char* in_colour = "it is in colour; a height map is grey";
constexpr const char* damaged = "it is damaged or of a kind that is not read; save it again";

std::string quoted(const std::filesystem::path& path) { return "'" + path.string() + "'"; }

struct FileCloser {
  void operator()(std::FILE* file) const { std::fclose(file); }
};

[[noreturn]] void failPng(png_structp png, png_const_charp text) {
  // The words of the library do not say what to do.
  *static_cast<std::string*>(png_get_error_ptr(png)) =
      std::strcmp(text, in_colour) == 0 ? in_colour : damaged;
  png_longjmp(png, 1);
}

/// Rows of 16-bit values, most significant byte first. Nothing here has a destructor that libpng
/// would jump over.
bool readPngRows(std::FILE* file, std::string& error, GreyImage& image, int& channels,
                 std::vector<std::uint8_t>& bytes, std::vector<png_bytep>& rows) {
  png_structp png = png_create_read_struct(PNG_LIBPNG_VER_STRING, &error, failPng,
                                           [](png_structp, png_const_charp) {});
  png_infop info = png_create_info_struct(png);
  bool good = false;
  if (setjmp(png_jmpbuf(png)) == 0) {
    png_init_io(png, file);
    png_set_user_limits(png, greatest_edge, greatest_edge);
    png_read_info(png, info);
    image.width = static_cast<int>(png_get_image_width(png, info));
    image.height = static_cast<int>(png_get_image_height(png, info));
    if ((png_get_color_type(png, info) & PNG_COLOR_MASK_COLOR) != 0) png_error(png, in_colour);
    if (png_get_bit_depth(png, info) < 8) png_set_expand_gray_1_2_4_to_8(png);
    png_set_expand_16(png);
    png_set_strip_alpha(png);
    png_set_interlace_handling(png);
    png_read_update_info(png, info);
    channels = png_get_channels(png, info);
    const std::size_t stride = png_get_rowbytes(png, info);
    bytes.resize(stride * static_cast<std::size_t>(image.height));
    for (int y = 0; y < image.height; ++y)
      rows.push_back(bytes.data() + stride * static_cast<std::size_t>(y));
    png_read_image(png, rows.data());
    png_read_end(png, nullptr);
    good = true;
  }
  png_destroy_read_struct(&png, &info, nullptr);
  return good;
}

GreyImage readPng(const std::filesystem::path& path) {
  const std::unique_ptr<std::FILE, FileCloser> file(std::fopen(path.c_str(), "rb"));
  if (!file) throw DataError("cannot read " + quoted(path));
  GreyImage image;
  std::string error;
  int channels = 1;
  std::vector<std::uint8_t> bytes;
  std::vector<png_bytep> rows;
  if (!readPngRows(file.get(), error, image, channels, bytes, rows))
    throw DataError(quoted(path) + " is no height map: " + error);
  const auto pixel_bytes = static_cast<std::size_t>(2 * channels);
  for (std::size_t at = 0; at + 1 < bytes.size(); at += pixel_bytes)
    image.values.push_back(static_cast<float>((bytes[at] << 8 | bytes[at + 1]) / 65535.0));
  return image;
}

GreyImage readExr(const std::filesystem::path& path) {
  try {
    Imf::InputFile file(path.c_str());
    const Imf::ChannelList& channels = file.header().channels();
    std::string name;
    int count = 0;
    for (auto channel = channels.begin(); channel != channels.end(); ++channel, ++count)
      name = channel.name();
    if (channels.findChannel("Y")) {
      name = "Y";
    } else if (count != 1) {
      throw DataError(quoted(path) +
                      " is no height map: it has several channels and none is called Y");
    }
    const Imath::Box2i window = file.header().dataWindow();
    GreyImage image;
    image.width = window.max.x - window.min.x + 1;
    image.height = window.max.y - window.min.y + 1;
    if (image.width > greatest_edge || image.height > greatest_edge)
      throw DataError(quoted(path) + " is no height map: it is too large");
    image.values.resize(static_cast<std::size_t>(image.width) *
                        static_cast<std::size_t>(image.height));
    Imf::FrameBuffer buffer;
    const auto stride = sizeof(float) * static_cast<std::size_t>(image.width);
    buffer.insert(name,
                  Imf::Slice::Make(Imf::FLOAT, image.values.data(), window, sizeof(float), stride));
    file.setFrameBuffer(buffer);
    file.readPixels(window.min.y, window.max.y);
    return image;
  } catch (const DataError&) {
    throw;
  } catch (const std::bad_alloc&) {
    throw;
  } catch (const std::exception&) {
    throw DataError(quoted(path) + " is no height map: " + damaged);
  }
}

}  // namespace

GreyImage readGreyImage(const std::filesystem::path& path) {
  if (!std::filesystem::is_regular_file(path)) throw UsageError("no such file " + quoted(path));
  std::array<char, 4> magic{};
  std::ifstream(path, std::ios::binary).read(magic.data(), magic.size());
  constexpr std::array<char, 4> png{'\x89', 'P', 'N', 'G'};
  constexpr std::array<char, 4> exr{'\x76', '\x2f', '\x31', '\x01'};
  if (magic != png && magic != exr)
    throw DataError(quoted(path) + " is neither a PNG nor an OpenEXR file");
  GreyImage image = magic == png ? readPng(path) : readExr(path);
  for (const float value : image.values) {
    if (!std::isfinite(value))
      throw DataError(quoted(path) + " holds values that are not finite numbers");
  }
  return image;
}

}  // namespace vdbdither
