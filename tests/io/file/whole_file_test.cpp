#include "io/file/whole_file.h"

#include <filesystem>
#include <sys/stat.h>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/scratch_folder.h"
#include "vdbdither/model/errors.h"

namespace vdbdither {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;
using testing::ThrowsMessage;

TEST(WholeFile, IsReadUpToALimit) {
  const test::ScratchFolder scratch;
  EXPECT_THAT(readWholeFile(scratch.write("a", "xyz"), "'a'", 3), ElementsAre('x', 'y', 'z'));
  EXPECT_THAT(readWholeFile(scratch.write("empty", ""), "'empty'", 0), IsEmpty());
  EXPECT_THAT([&] { readWholeFile(scratch / "a", "'a'", 2); },
              ThrowsMessage<DataError>("'a' has 3 bytes; at most 2 are read"));
}

TEST(WholeFile, IsAnOrdinaryOne) {
  const test::ScratchFolder scratch;
  EXPECT_THAT([&] { readWholeFile(scratch / "gone", "'gone'", 9); },
              ThrowsMessage<DataError>("cannot read 'gone': No such file or directory"));
  ASSERT_EQ(mkfifo((scratch / "pipe").c_str(), 0600), 0);
  const std::filesystem::path folder = scratch.path();
  for (const std::filesystem::path& path :
       {scratch / "pipe", folder, std::filesystem::path("/dev/zero")}) {
    EXPECT_THAT([&] { readWholeFile(path, "this", 9); },
                ThrowsMessage<DataError>("this is not an ordinary file"));
  }
}

}  // namespace
}  // namespace vdbdither
