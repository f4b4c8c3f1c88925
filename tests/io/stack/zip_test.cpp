#include "io/stack/zip.h"

#include <fstream>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "io/file/staged_output.h"
#include "tests/support/png_reader.h"
#include "tests/support/scratch_folder.h"
#include "vdbdither/model/errors.h"

namespace vdbdither {
namespace {

using Bytes = std::vector<std::uint8_t>;
using testing::HasSubstr;
using testing::ThrowsMessage;

Bytes bytesOf(const std::string& text) { return {text.begin(), text.end()}; }

TEST(Zip, FilesComeBackByName) {
  const test::ScratchFolder scratch;
  ZipWriter writer(scratch / "a.zip", "a.zip");
  writer.add("one.txt", bytesOf("first"));
  writer.add("folder/zwei-ä.bin", Bytes(100000, 7));
  writer.add("empty", {});
  writer.finish();
  ZipReader reader(scratch / "a.zip");
  EXPECT_EQ(reader.read("folder/zwei-ä.bin"), Bytes(100000, 7));
  EXPECT_EQ(reader.read("one.txt"), bytesOf("first"));
  EXPECT_EQ(reader.read("empty"), Bytes());
  EXPECT_FALSE(reader.contains("two"));
  EXPECT_THAT([&] { static_cast<void>(reader.read("two")); },
              ThrowsMessage<DataError>(HasSubstr("holds no file 'two'")));
}

TEST(Zip, SameFilesGiveTheSameBytesAndAreStored) {
  const test::ScratchFolder scratch;
  for (const char* name : {"a.zip", "b.zip"}) {
    ZipWriter writer(scratch / name, name);
    writer.add("x", bytesOf("not packed any more"));
    writer.finish();
  }
  const Bytes bytes = test::fileBytes(scratch / "a.zip");
  EXPECT_EQ(bytes, test::fileBytes(scratch / "b.zip"));
  const std::string text(bytes.begin(), bytes.end());
  EXPECT_THAT(text, HasSubstr("not packed any more"));
  // Bit 3 of the flags would put lengths behind the files.
  EXPECT_EQ(bytes[6] & 8, 0);
}

TEST(Zip, HoldsMoreFilesThanSixteenBitsCount) {
  const test::ScratchFolder scratch;
  constexpr int count = 70000;
  ZipWriter writer(scratch / "a.zip", "a.zip");
  for (int i = 0; i < count; ++i) writer.add(std::to_string(i), {});
  writer.finish();
  const ZipReader reader(scratch / "a.zip");
  for (int i = 0; i < count; ++i) ASSERT_TRUE(reader.contains(std::to_string(i))) << i;
}

TEST(Zip, DamageIsFound) {
  const test::ScratchFolder scratch;
  ZipWriter writer(scratch / "a.zip", "a.zip");
  writer.add("x", bytesOf("some text"));
  writer.finish();
  Bytes bytes = test::fileBytes(scratch / "a.zip");
  const std::string text(bytes.begin(), bytes.end());
  bytes[text.find("some")] ^= 1;
  writeFile(scratch / "a.zip", bytes, "a.zip");
  ZipReader reader(scratch / "a.zip");
  EXPECT_THAT([&] { static_cast<void>(reader.read("x")); },
              ThrowsMessage<DataError>(HasSubstr("its file 'x' is damaged")));
  std::ofstream(scratch / "b.zip") << "no archive";
  EXPECT_THAT([&] { ZipReader(scratch / "b.zip"); },
              ThrowsMessage<DataError>(HasSubstr("b.zip' is not a readable zip archive")));
}

}  // namespace
}  // namespace vdbdither
