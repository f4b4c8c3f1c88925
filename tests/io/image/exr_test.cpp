#include "io/image/exr.h"

#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/span_images.h"
#include "vdbdither/model/errors.h"

namespace vdbdither {
namespace {

using testing::HasSubstr;
using testing::ThrowsMessage;
using Bytes = std::vector<std::uint8_t>;

std::uint32_t indexAt(std::uint32_t x, std::uint32_t y) { return (x / 3 + y) % 5; }

Bytes sliceOf(const ExrFormat& format, int extra_channels = 0) {
  std::vector<ExrChannel> channels{{"material", true}};
  for (int i = 0; i < extra_channels; ++i) channels.push_back({"x" + std::to_string(i), false});
  return encodeExr(17, 9, format, channels,
                   [](std::uint32_t row, std::size_t, std::span<float> values) {
                     for (std::uint32_t x = 0; x < values.size(); ++x)
                       values[x] = static_cast<float>(indexAt(x, row));
                   });
}

/// Where the values of an attribute begin: behind its name, its type and its size.
std::size_t valuesOf(const Bytes& bytes, const std::string& name, const std::string& type) {
  const std::string text(bytes.begin(), bytes.end());
  return text.find(name + '\0' + type) + name.size() + type.size() + 2 + 4;
}

void put(Bytes& bytes, std::size_t at, std::uint32_t value) {
  for (std::size_t i = 0; i < 4; ++i) bytes[at + i] = static_cast<std::uint8_t>(value >> 8 * i);
}

void expectRefused(const Bytes& bytes, const std::string& message) {
  EXPECT_THAT([&] { decodeExr(bytes, "material"); }, ThrowsMessage<DataError>(HasSubstr(message)));
}

TEST(Exr, MaterialsComeBack) {
  const SpanImage image = test::spanImage(17, 9, indexAt);
  for (const auto packing : {ExrPacking::none, ExrPacking::zip, ExrPacking::piz}) {
    for (const int tile : {0, 8, 4096})
      EXPECT_EQ(decodeExr(sliceOf({1, packing, tile}, 3), "material"), image) << tile;
  }
}

// OpenEXR takes memory for what a header claims.
TEST(Exr, RefusesWhatAHeaderOnlyClaims) {
  const Bytes slice = sliceOf({1, ExrPacking::piz});
  Bytes attribute = slice;
  put(attribute, valuesOf(slice, "compression", "compression") - 4, 1 << 30);
  expectRefused(attribute, "is not a readable EXR: it is cut short");
  Bytes rows = slice;
  put(rows, valuesOf(slice, "dataWindow", "box2i") + 12, 1 << 20);
  expectRefused(rows, "is not a readable EXR: it is cut short");
  Bytes channels = sliceOf({1, ExrPacking::piz}, 40);
  put(channels, valuesOf(channels, "dataWindow", "box2i") + 8, 1 << 20);
  expectRefused(channels, "is an EXR of too many channels");
}

TEST(Exr, RefusesOtherKindsAndDamage) {
  const Bytes slice = sliceOf({1, ExrPacking::zips});
  EXPECT_THAT([&] { decodeExr(slice, "distance"); },
              ThrowsMessage<DataError>("has no channel 'distance'"));
  expectRefused({0x76, 0x2f, 0x31, 0x01, 2, 8, 0, 0}, "is a deep EXR; save it flat");
  for (std::size_t size = 0; size < slice.size(); size += 7)
    expectRefused({slice.begin(), slice.begin() + static_cast<std::ptrdiff_t>(size)}, "is ");
}

}  // namespace
}  // namespace vdbdither
