#include "io/image/grey_image.h"

#include <cmath>
#include <fstream>
#include <iterator>
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <png.h>

#include "io/image/exr.h"
#include "io/image/png_spans.h"
#include "tests/support/scratch_folder.h"
#include "vdbdither/model/errors.h"

namespace vdbdither {
namespace {

using testing::HasSubstr;
using testing::ThrowsMessage;

class GreyImageFile : public testing::Test {
 protected:
  /// Through libpng's simple interface; `format` is one of its own.
  std::filesystem::path png(png_uint_32 format, int width, int height, const void* pixels) {
    png_image image{};
    image.version = PNG_IMAGE_VERSION;
    image.width = static_cast<png_uint_32>(width);
    image.height = static_cast<png_uint_32>(height);
    image.format = format;
    EXPECT_TRUE(png_image_write_to_file(&image, path.c_str(), 0, pixels, 0, nullptr));
    return path;
  }

  std::filesystem::path exr(const std::vector<ExrChannel>& channels, float scale) {
    const std::vector<std::uint8_t> bytes =
        encodeExr(3, 2, ExrFormat{}, channels,
                  [&](std::uint32_t row, std::size_t channel, std::span<float> values) {
                    for (std::size_t x = 0; x < values.size(); ++x)
                      values[x] = scale * static_cast<float>(10 * row + x + 100 * channel);
                  });
    std::ofstream(path, std::ios::binary)
        .write(reinterpret_cast<const char*>(bytes.data()),
               static_cast<std::streamsize>(bytes.size()));
    return path;
  }

  test::ScratchFolder folder;
  std::filesystem::path path = folder / "map";
};

TEST_F(GreyImageFile, OfEightBitsIsReadAsItsNumbersOver255) {
  const std::vector<std::uint8_t> pixels{0, 51, 255, 102, 3, 204};
  const GreyImage image = readGreyImage(png(PNG_FORMAT_GRAY, 3, 2, pixels.data()));
  EXPECT_EQ(image.width, 3);
  EXPECT_EQ(image.height, 2);
  for (std::size_t n = 0; n < pixels.size(); ++n)
    EXPECT_FLOAT_EQ(image.values[n], static_cast<float>(pixels[n]) / 255);
}

TEST_F(GreyImageFile, OfEXRIsReadAsItsNumbersAre) {
  const GreyImage image = readGreyImage(exr({{"Y", false}}, -0.25F));
  EXPECT_EQ(image.width, 3);
  EXPECT_EQ(image.height, 2);
  EXPECT_EQ(image.values, (std::vector<float>{-0.0F, -0.25F, -0.5F, -2.5F, -2.75F, -3.0F}));
  EXPECT_EQ(readGreyImage(exr({{"height", true}}, 1)).values[4], 11);
  EXPECT_EQ(readGreyImage(exr({{"A", true}, {"Y", true}}, 1)).values[0], 100);
}

TEST_F(GreyImageFile, RefusesWhatIsNoHeightMap) {
  const auto reading = [this] { readGreyImage(path); };
  EXPECT_THAT(reading, ThrowsMessage<UsageError>(HasSubstr("no such file")));
  std::ofstream(path) << "P5 1 1 255 x";
  EXPECT_THAT(reading, ThrowsMessage<DataError>(HasSubstr("is neither a PNG nor an OpenEXR file")));
  const std::vector<std::uint8_t> colours(12, 7);
  png(PNG_FORMAT_RGB, 2, 2, colours.data());
  EXPECT_THAT(reading,
              ThrowsMessage<DataError>(HasSubstr("it is in colour; a height map is grey")));
  exr({{"R", true}, {"G", true}}, 1);
  EXPECT_THAT(reading,
              ThrowsMessage<DataError>(HasSubstr("several channels and none is called Y")));
  exr({{"Y", false}}, std::nanf(""));
  EXPECT_THAT(reading, ThrowsMessage<DataError>(HasSubstr("not finite numbers")));
  const std::vector<std::uint8_t> grey(4, 7);
  png(PNG_FORMAT_GRAY, 2, 2, grey.data());
  std::filesystem::resize_file(path, std::filesystem::file_size(path) - 20);
  EXPECT_THAT(reading, ThrowsMessage<DataError>(
                           HasSubstr("is no height map: it is not a readable PNG: it is cut")));
  exr({{"Y", false}}, 1);
  std::filesystem::resize_file(path, std::filesystem::file_size(path) - 20);
  EXPECT_THAT(reading, ThrowsMessage<DataError>(HasSubstr("is no height map: it is ")));
}

TEST_F(GreyImageFile, RefusesMorePixelsThanAreRead) {
  const auto reading = [this] { readGreyImage(path); };
  const auto write = [this](const std::vector<std::uint8_t>& bytes) {
    std::ofstream(path, std::ios::binary)
        .write(reinterpret_cast<const char*>(bytes.data()),
               static_cast<std::streamsize>(bytes.size()));
  };
  for (const auto& [width, height] : {std::pair(65537U, 1U), std::pair(16385U, 16385U)}) {
    SpansBuilder blank(width);
    for (std::uint32_t y = 0; y < height; ++y) blank.endRow();
    write(encodePng(blank.finish(), {.pixels = PngPixels::grey1, .palette = {}}));
    EXPECT_THAT(reading, ThrowsMessage<DataError>(HasSubstr(
                             "is no height map: it has " + std::to_string(width) + " x " +
                             std::to_string(height) + " pixels; at most 268435456 are read")));
  }
  // The lower right corner of the window at 16385, 16385.
  exr({{"Y", false}}, 1);
  std::fstream file(path, std::ios::binary | std::ios::in | std::ios::out);
  std::string text(std::istreambuf_iterator<char>(file), {});
  file.seekp(static_cast<std::streamoff>(text.find("dataWindow") + 11 + 6 + 4 + 8));
  file.write("\x01\x40\0\0\x01\x40\0\0", 8).flush();
  EXPECT_THAT(reading, ThrowsMessage<DataError>(HasSubstr("it has 16386 x 16386 pixels; at most")));
}

}  // namespace
}  // namespace vdbdither
