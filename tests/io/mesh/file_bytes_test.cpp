#include "io/mesh/file_bytes.h"

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/scratch_folder.h"
#include "vdbdither/model/errors.h"

namespace vdbdither::test {
namespace {

using testing::HasSubstr;
using testing::ThrowsMessage;

constexpr std::size_t head_size = 64 << 10;

std::string longText() {
  std::string text;
  while (text.size() < 3 * head_size) text += std::to_string(text.size()) + "\n";
  return text;
}

TEST(FileBytes, TheHeadBeginsWhereAllBytesDo) {
  const ScratchFolder folder;
  const std::string text = longText();
  FileBytes file(folder.write("part.obj", text).string());
  EXPECT_EQ(file.size(), text.size());
  EXPECT_EQ(file.head(), text.substr(0, head_size));
  const char* begin = file.head().data();
  EXPECT_EQ(file.all(), text);
  EXPECT_EQ(file.all().data(), begin);
}

TEST(FileBytes, TheHeadOfASmallFileIsAllOfIt) {
  const ScratchFolder folder;
  FileBytes file(folder.write("part.obj", "v 0 0 0\n").string());
  EXPECT_EQ(file.head(), "v 0 0 0\n");
  EXPECT_EQ(file.all(), "v 0 0 0\n");
  EXPECT_EQ(FileBytes(folder.write("empty.obj", "").string()).all(), "");
}

TEST(FileBytes, RefusesAFileThatIsCutOffWhileItIsRead) {
  const ScratchFolder folder;
  const auto path = folder.write("part.stl", longText());
  for (const std::size_t size : {head_size + 5, std::size_t{7}}) {
    folder.write("part.stl", longText());
    FileBytes file(path.string());
    std::filesystem::resize_file(path, size);
    EXPECT_THAT([&] { file.all(); },
                ThrowsMessage<DataError>("'" + path.string() +
                                         "': was cut off while it was read, at "
                                         "byte " +
                                         std::to_string(std::max(size, head_size)) + " of " +
                                         std::to_string(longText().size()) +
                                         "; try again once it is complete"));
  }
}

TEST(FileBytes, RefusesAFileThatIsWrittenToWhileItIsRead) {
  const ScratchFolder folder;
  const auto path = folder.write("part.stl", longText());
  const auto changed =
      "'" + path.string() + "': was written to while it was read; try again once it is complete";
  FileBytes longer(path.string());
  std::ofstream(path, std::ios::app) << "more";
  EXPECT_THAT([&] { longer.all(); }, ThrowsMessage<DataError>(changed));
  FileBytes other(path.string());
  std::filesystem::last_write_time(
      path, std::filesystem::last_write_time(path) + std::chrono::seconds(1));
  EXPECT_THAT([&] { other.all(); }, ThrowsMessage<DataError>(changed));
}

TEST(FileBytes, AFileLargerThanMemoryIsRefused) {
  const ScratchFolder folder;
  const auto path = folder.write("part.stl", "solid");
  std::filesystem::resize_file(path, std::uintmax_t{1} << 42);
  FileBytes file(path.string());
  EXPECT_EQ(file.head().substr(0, 6), std::string_view("solid\0", 6));
  EXPECT_THAT(
      [&] { file.all(); },
      ThrowsMessage<DataError>(HasSubstr("its 4398046511104 bytes do not fit into memory")));
}

}  // namespace
}  // namespace vdbdither::test
