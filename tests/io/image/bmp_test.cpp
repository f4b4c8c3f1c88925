#include "io/image/bmp.h"

#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/span_images.h"
#include "vdbdither/model/errors.h"

namespace vdbdither {
namespace {

using testing::ElementsAre;
using testing::ThrowsMessage;

TEST(Bmp, IsTheBitmapOfWindowsWithRowsFromTheBottomUp) {
  const SpanImage image =
      test::spanImage(11, 2, [](int x, int y) { return y == 0 ? x == 0 || x > 8 : x < 9; });
  const std::vector<std::uint8_t> bytes = encodeBmp(image, 0.05, 0.1);
  ASSERT_EQ(bytes.size(), 70U);
  EXPECT_THAT(std::vector(bytes.begin(), bytes.begin() + 14),
              ElementsAre('B', 'M', 70, 0, 0, 0, 0, 0, 0, 0, 62, 0, 0, 0));
  EXPECT_THAT(std::vector(bytes.begin() + 14, bytes.begin() + 54),
              ElementsAre(40, 0, 0, 0, 11, 0, 0, 0, 2, 0, 0, 0, 1, 0, 1, 0, 0, 0, 0, 0,  //
                          8, 0, 0, 0, 0x20, 0x4e, 0, 0, 0x10, 0x27, 0, 0, 2, 0, 0, 0, 2, 0, 0, 0));
  EXPECT_THAT(std::vector(bytes.begin() + 54, bytes.end()),
              ElementsAre(0, 0, 0, 0, 255, 255, 255, 0, 0xff, 0x80, 0, 0, 0x80, 0x60, 0, 0));
}

TEST(Bmp, ReadsBackWhatItWrites) {
  for (const int width : {1, 7, 8, 31, 32, 33, 200}) {
    const SpanImage image = test::ditheredDisc(width, 40, 9, 3);
    EXPECT_TRUE(decodeBmp(encodeBmp(image, 0, 0)) == image) << width;
  }
}

TEST(Bmp, ReadsRowsFromTheTopDownAndAPaletteThatIsTurned) {
  const SpanImage image = test::spanImage(5, 3, [](int x, int y) { return x == y; });
  std::vector<std::uint8_t> bytes = encodeBmp(image, 0, 0);
  bytes[22] = 0xfd;
  bytes[23] = bytes[24] = bytes[25] = 0xff;
  EXPECT_TRUE(decodeBmp(bytes) == test::spanImage(5, 3, [](int x, int y) { return x == 2 - y; }));
  std::swap_ranges(bytes.begin() + 54, bytes.begin() + 58, bytes.begin() + 58);
  EXPECT_TRUE(decodeBmp(bytes) == test::spanImage(5, 3, [](int x, int y) { return x != 2 - y; }));
}

TEST(Bmp, RefusesWhatIsDamagedOrOfOtherKinds) {
  const std::vector<std::uint8_t> good =
      encodeBmp(test::spanImage(9, 9, [](int x, int) { return x % 2; }), 0, 0);
  const auto refusal = [&](std::size_t at, std::uint8_t byte) {
    std::vector<std::uint8_t> bytes = good;
    bytes[at] = byte;
    return [bytes] { decodeBmp(bytes); };
  };
  EXPECT_THAT(refusal(0, 'X'), ThrowsMessage<DataError>("is not a BMP"));
  for (const std::size_t at : {std::size_t{14}, std::size_t{28}, std::size_t{30}}) {
    EXPECT_THAT(refusal(at, 8),
                ThrowsMessage<DataError>("is not an uncompressed BMP of one bit a pixel"));
  }
  EXPECT_THAT(refusal(22, 10), ThrowsMessage<DataError>("is a BMP that ends before its last row"));
  EXPECT_THAT(refusal(10, 255), ThrowsMessage<DataError>("is a BMP that ends before its last row"));
  EXPECT_THAT(refusal(18, 0), ThrowsMessage<DataError>(
                                  "is a BMP without pixels, or with more than can be counted"));
  std::mt19937 random(3);
  for (int trial = 0; trial < 2000; ++trial) {
    std::vector<std::uint8_t> bytes = good;
    bytes[random() % 62] = static_cast<std::uint8_t>(random());
    bytes.resize(random() % (bytes.size() + 1));
    try {
      decodeBmp(bytes);
    } catch (const DataError& error) {
      EXPECT_EQ(std::string(error.what()).find('\n'), std::string::npos);
    }
  }
}

TEST(Bmp, ChecksTheSizeFirst) {
  const std::vector<std::uint8_t> bytes =
      encodeBmp(test::spanImage(9, 4, [](int, int) { return 1; }), 0, 0);
  EXPECT_THAT(
      [&] {
        decodeBmp(bytes, [](std::uint32_t width, std::uint32_t height) {
          throw DataError(std::to_string(width) + " x " + std::to_string(height));
        });
      },
      ThrowsMessage<DataError>("9 x 4"));
}

}  // namespace
}  // namespace vdbdither
