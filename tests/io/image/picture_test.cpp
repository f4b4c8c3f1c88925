#include "io/image/picture.h"

#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "io/file/staged_output.h"
#include "io/image/png_spans.h"
#include "tests/support/png_reader.h"
#include "tests/support/scratch_folder.h"
#include "vdbdither/model/errors.h"

namespace vdbdither {
namespace {

using testing::HasSubstr;
using testing::ThrowsMessage;

Picture drawn() {
  Picture picture{5, 3, {}};
  for (std::uint8_t i = 0; i < 15; ++i)
    picture.pixels.push_back(rgba(i, static_cast<std::uint8_t>(255 - i), 7,
                                  i % 4 == 0 ? 0 : static_cast<std::uint8_t>(17 * i)));
  return picture;
}

TEST(Pictures, ComeBackAsTheyWere) {
  const test::ScratchFolder scratch;
  const std::vector<std::uint8_t> bytes = encodePicture(drawn());
  writeFile(scratch / "a.png", bytes, "a.png");
  EXPECT_EQ(readPicture(scratch / "a.png"), drawn());
}

TEST(Pictures, AreReadByOthers) {
  const test::PngImage image = test::readPng(encodePicture(drawn()));
  EXPECT_EQ(image.width, 5U);
  EXPECT_EQ(image.height, 3U);
  EXPECT_EQ(image.bit_depth, 8);
  EXPECT_EQ(image.colour_type, 6);
  ASSERT_EQ(image.rows.size(), 60U);
  EXPECT_EQ(image.rows[4], 1);
  EXPECT_EQ(image.rows[5], 254);
}

TEST(Pictures, WhatCannotBeReadIsTold) {
  const test::ScratchFolder scratch;
  EXPECT_THAT([&] { readPicture(scratch / "none.png"); },
              ThrowsMessage<DataError>(HasSubstr("no such file '")));
  std::ofstream(scratch / "text.png") << "no picture at all";
  EXPECT_THAT([&] { readPicture(scratch / "text.png"); },
              ThrowsMessage<DataError>(HasSubstr("text.png' is not a readable PNG")));
  EXPECT_THAT([] { encodePicture({}); },
              ThrowsMessage<DataError>(HasSubstr("the picture cannot be written")));
}

}  // namespace
}  // namespace vdbdither
