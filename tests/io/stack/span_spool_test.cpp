#include "io/stack/span_spool.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/scratch_folder.h"
#include "tests/support/span_images.h"
#include "vdbdither/model/errors.h"

namespace vdbdither {
namespace {

using testing::HasSubstr;
using testing::ThrowsMessage;

TEST(SpanSpool, GivesBackEveryImageInAnyOrder) {
  const test::ScratchFolder scratch;
  SpanSpool spool(scratch.path());
  std::vector<SpanImage> images;
  for (int i = 0; i < 5; ++i) {
    images.push_back(test::spanImage(300 + i, 20, [&](int x, int y) {
      return static_cast<std::uint32_t>(x * x + y * i) % 7 > 2 ? 0xff00ff00U + i : x / 150;
    }));
    spool.add(images.back());
  }
  ASSERT_EQ(spool.size(), 5U);
  for (const std::size_t i : {4U, 0U, 2U, 1U, 3U}) EXPECT_TRUE(spool.read(i) == images[i]) << i;
  EXPECT_TRUE(test::filesUnder(scratch.path()).empty());
}

TEST(SpanSpool, SaysWhereItCannotWrite) {
  const test::ScratchFolder scratch;
  EXPECT_THAT([&] { SpanSpool spool(scratch / "none"); },
              ThrowsMessage<DataError>(HasSubstr("cannot keep slices in a temporary file in '")));
}

}  // namespace
}  // namespace vdbdither
