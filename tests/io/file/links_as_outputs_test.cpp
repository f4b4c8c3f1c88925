#include <filesystem>
#include <set>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "io/file/staged_output.h"
#include "tests/io/file/small_files.h"
#include "tests/support/scratch_folder.h"
#include "vdbdither/model/errors.h"

namespace vdbdither {
namespace {

namespace fs = std::filesystem;
using Kind = StagedOutput::Kind;
using test::one;
using test::put;
using test::two;
using testing::Pair;
using testing::ThrowsMessage;
using testing::UnorderedElementsAre;

TEST(LinksAsOutputs, ALinkStaysAndWhatItLeadsToIsReplaced) {
  const test::ScratchFolder scratch;
  fs::create_directories(scratch / "deep/real");
  put(scratch / "deep/real/old", one);
  put(scratch / "deep/file", one);
  fs::create_symlink("deep/real/", scratch / "folder");
  fs::create_symlink("deep/link", scratch / "file");
  fs::create_symlink("file", scratch / "deep/link");
  fs::create_symlink("deep/new", scratch / "dangling");
  for (const char* name : {"folder", "dangling"}) {
    StagedOutput::check(scratch / name, Kind::folder, true);
    StagedOutput output(scratch / name, Kind::folder, test::ownFiles);
    output.write("new", two);
    output.commit();
  }
  StagedOutput::check(scratch / "file", Kind::file, true);
  StagedOutput output(scratch / "file", Kind::file);
  EXPECT_EQ(output.path().parent_path(), scratch / "deep");
  put(output.path(), two);
  output.commit();
  for (const char* name : {"folder", "file", "dangling", "deep/link"})
    EXPECT_TRUE(fs::is_symlink(scratch / name)) << name;
  EXPECT_THAT(test::filesUnder(scratch.path()),
              UnorderedElementsAre(Pair("deep/real/new", two), Pair("deep/file", two),
                                   Pair("deep/new/new", two)));
}

TEST(LinksAsOutputs, ALinkThatLeadsNowhereIsRefused) {
  const test::ScratchFolder scratch;
  fs::create_symlink("loop", scratch / "loop");
  fs::create_symlink("no/such", scratch / "lost");
  EXPECT_THAT([&] { StagedOutput::check(scratch / "loop", Kind::file, true); },
              ThrowsMessage<UsageError>("cannot write to '" + (scratch / "loop").string() +
                                        "': the link leads nowhere"));
  EXPECT_THAT(
      [&] { StagedOutput::check(scratch / "lost", Kind::file, true); },
      ThrowsMessage<UsageError>("cannot write to '" + (scratch / "lost").string() +
                                "': there is no folder '" + (scratch / "no").string() + "'"));
}

TEST(LinksAsOutputs, TheParentBehindALinkIsThatOfItsTarget) {
  const test::ScratchFolder scratch;
  fs::create_directories(scratch / "far/away");
  fs::create_directory_symlink("far/away", scratch / "link");
  StagedOutput output(scratch / "link/../out", Kind::folder);
  output.write("new", two);
  output.commit();
  EXPECT_THAT(test::filesUnder(scratch.path()), UnorderedElementsAre(Pair("far/out/new", two)));
}

}  // namespace
}  // namespace vdbdither
