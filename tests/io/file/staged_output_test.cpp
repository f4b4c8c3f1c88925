#include "io/file/staged_output.h"

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <fcntl.h>
#include <fstream>
#include <functional>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <thread>
#include <tuple>
#include <unistd.h>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "io/file/staging_name.h"
#include "tests/io/file/small_files.h"
#include "tests/support/scratch_folder.h"
#include "vdbdither/model/errors.h"
#include "vdbdither/model/interrupt.h"

namespace {

// A file system that cannot exchange, and a process that dies between two renames.
bool exchanges = true;
int renames_to_live = -1;
std::string rename_that_fails;  ///< the path that cannot be renamed

}  // namespace

extern "C" int renameat2(int from_folder, const char* from, int to_folder, const char* to,
                         unsigned flags) noexcept {
  if (flags != 0 && !exchanges) {
    errno = EINVAL;
    return -1;
  }
  if (rename_that_fails == from) {
    errno = EXDEV;
    return -1;
  }
  if (renames_to_live == 0) _exit(0);
  if (renames_to_live > 0) --renames_to_live;
  return static_cast<int>(::syscall(SYS_renameat2, from_folder, from, to_folder, to, flags));
}

namespace vdbdither {
namespace {

namespace fs = std::filesystem;
using Kind = StagedOutput::Kind;
using test::one;
using test::ownFiles;
using test::put;
using test::two;
using testing::EndsWith;
using testing::IsEmpty;
using testing::Pair;
using testing::SizeIs;
using testing::ThrowsMessage;
using testing::UnorderedElementsAre;

/// Runs `function` in a process of its own, which ends without cleaning up.
void inAnotherProcess(const std::function<void()>& function) {
  const pid_t child = fork();
  if (child == 0) {
    function();
    _exit(0);
  }
  int status = 0;
  ASSERT_EQ(waitpid(child, &status, 0), child);
  ASSERT_EQ(status, 0);
}

std::vector<std::string> namesIn(const fs::path& folder) {
  std::vector<std::string> names;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder))
    names.push_back(entry.path().filename().string());
  return names;
}

/// A folder `out` with the files of an earlier output.
class OldStack : public testing::Test {
 protected:
  void SetUp() override {
    fs::create_directories(scratch_ / "out/white");
    put(scratch_ / "out/old", one);
    put(scratch_ / "out/white/old", one);
  }
  void TearDown() override {
    exchanges = true;
    rename_that_fails.clear();
  }

  /// The refusal of overwriting it, with TMP for the scratch folder.
  [[nodiscard]] std::string refusal(const std::string& name = "out") const {
    try {
      StagedOutput::checkFolder(scratch_ / name, true, ownFiles,
                                [](const std::string& text) { FAIL() << text; });
    } catch (const UsageError& error) {
      std::string text = error.what();
      for (std::size_t at; (at = text.find(scratch_.path().string())) != std::string::npos;)
        text.replace(at, scratch_.path().string().size(), "TMP");
      return text;
    }
    return "";
  }

  void replace() const {
    StagedOutput output(scratch_ / "out", Kind::folder, ownFiles);
    output.write("new", two);
    output.commit();
  }

  test::ScratchFolder scratch_;
};

TEST(StagedOutput, AFolderExistsOnlyOnceCommitted) {
  const test::ScratchFolder scratch;
  StagedOutput output(scratch / "out", Kind::folder);
  output.write("a", one);
  output.write("deep/er/b", two);
  EXPECT_FALSE(fs::exists(scratch / "out"));
  output.commit();
  EXPECT_THAT(test::filesUnder(scratch.path()),
              UnorderedElementsAre(Pair("out/a", one), Pair("out/deep/er/b", two)));
}

TEST(StagedOutput, AFileExistsOnlyOnceCommitted) {
  const test::ScratchFolder scratch;
  StagedOutput output(scratch / "a.vdb", Kind::file);
  put(output.path(), one);
  EXPECT_FALSE(fs::exists(scratch / "a.vdb"));
  output.commit();
  EXPECT_THAT(test::filesUnder(scratch.path()), UnorderedElementsAre(Pair("a.vdb", one)));
}

TEST(StagedOutput, ACompleteOutputHasNoNameUntilItIsCommitted) {
  const test::ScratchFolder scratch;
  put(scratch / "old", one);
  {
    StagedOutput output(scratch / "old", Kind::file);
    put(output.path(), two);
    output.complete();
    EXPECT_EQ(test::filesUnder(scratch.path()).at("old"), one);
  }
  EXPECT_THAT(test::filesUnder(scratch.path()), UnorderedElementsAre(Pair("old", one)));
  StagedOutput output(scratch / "old", Kind::file);
  put(output.path(), two);
  output.complete();
  output.commit();
  EXPECT_THAT(test::filesUnder(scratch.path()), UnorderedElementsAre(Pair("old", two)));
}

TEST(StagedOutput, WithoutCommitNothingRemainsAndTheOldStays) {
  const test::ScratchFolder scratch;
  fs::create_directory(scratch / "out");
  put(scratch / "out/old", one);
  {
    StagedOutput output(scratch / "out/", Kind::folder);
    output.write("new", two);
  }
  EXPECT_THAT(test::filesUnder(scratch.path()), UnorderedElementsAre(Pair("out/old", one)));
  EXPECT_EQ(std::distance(fs::directory_iterator(scratch.path()), {}), 1);
}

TEST(StagedOutput, ReplacesTheWholeOfTheOld) {
  const test::ScratchFolder scratch;
  fs::create_directory(scratch / "out");
  put(scratch / "out/old", one);
  put(scratch / "file", one);
  StagedOutput folder(scratch / "out/", Kind::folder, ownFiles);
  folder.write("new", two);
  folder.commit();
  StagedOutput file(scratch / "file", Kind::file);
  put(file.path(), two);
  file.commit();
  EXPECT_THAT(test::filesUnder(scratch.path()),
              UnorderedElementsAre(Pair("out/new", two), Pair("file", two)));
  EXPECT_EQ(std::distance(fs::directory_iterator(scratch.path()), {}), 2);
}

TEST(StagedOutput, RemovesWhatAKilledRunLeftButNotALivingOnes) {
  const test::ScratchFolder scratch;
  inAnotherProcess([&] {
    const auto* output = new StagedOutput(scratch / "out", Kind::folder);
    output->write("half", one);
    put(output->path().string() + "-faces", one);
  });
  ASSERT_THAT(namesIn(scratch.path()), SizeIs(2));
  // Made by a process that lives, by one of another machine, by the same process for another name.
  std::string living = stagingPath(scratch / "out").string();
  living.replace(living.rfind('-') + 1, living.npos, std::to_string(getppid()));
  std::string elsewhere = (scratch / ".out.partial-00000000-").string() + std::to_string(1 << 29);
  put(living, one);
  put(elsewhere, one);
  put(scratch / ".out.partial-mine", one);
  put(scratch / ".out2.partial-mine", one);
  StagedOutput(scratch / "out", Kind::folder).commit();
  EXPECT_THAT(
      namesIn(scratch.path()),
      UnorderedElementsAre("out", fs::path(living).filename(), fs::path(elsewhere).filename(),
                           ".out.partial-mine", ".out2.partial-mine"));
}

TEST_F(OldStack, IsReplacedButForFilesOfOthers) {
  EXPECT_EQ(refusal(), "");
  replace();
  EXPECT_THAT(test::filesUnder(scratch_.path()), UnorderedElementsAre(Pair("out/new", two)));
  EXPECT_THAT(namesIn(scratch_ / "out"), UnorderedElementsAre("new"));
}

TEST_F(OldStack, WithFilesOfOthersIsRefused) {
  const std::string rest =
      ", which was not written with the rest; move it elsewhere, or name another folder";
  put(scratch_ / "out/notes.txt", one);
  EXPECT_EQ(refusal(), "'TMP/out' holds 'notes.txt'" + rest);
  put(scratch_ / "out/.hidden", one);
  EXPECT_EQ(refusal(), "'TMP/out' holds '.hidden'" + rest);
  fs::remove(scratch_ / "out/.hidden");
  fs::remove(scratch_ / "out/notes.txt");
  put(scratch_ / "out/white/mine", one);
  EXPECT_EQ(refusal(), "'TMP/out' holds 'white/mine'" + rest);
  fs::remove(scratch_ / "out/white/mine");
  fs::create_directory(scratch_ / "out/empty");
  EXPECT_EQ(refusal(), "'TMP/out' holds 'empty'" + rest);
  fs::remove(scratch_ / "out/empty");
  fs::remove(scratch_ / "out/old");
  fs::create_directory(scratch_ / "out/old");
  EXPECT_EQ(refusal(), "'TMP/out' holds 'old'" + rest);
  fs::remove(scratch_ / "out/old");
  fs::remove_all(scratch_ / "out/white");
  fs::create_directory(scratch_ / "elsewhere");
  put(scratch_ / "elsewhere/old", one);
  fs::create_directory_symlink(scratch_ / "elsewhere", scratch_ / "out/white");
  EXPECT_EQ(refusal(), "'TMP/out' holds 'white'" + rest);
}

TEST_F(OldStack, OfWhichSomeIsMissingIsReplaced) {
  fs::remove_all(scratch_ / "out/white");
  EXPECT_EQ(refusal(), "");
}

TEST_F(OldStack, KeepsFilesThatOthersAddWhileTheNewOneIsWritten) {
  for (const bool can_exchange : {true, false}) {
    exchanges = can_exchange;
    StagedOutput output(scratch_ / "out", Kind::folder, ownFiles);
    output.write("new", two);
    put(scratch_ / "out/notes.txt", one);
    put(scratch_ / "out/new", one);
    fs::create_directories(scratch_ / "out/mine/deep");
    put(scratch_ / "out/mine/deep/a", one);
    output.commit();
    EXPECT_THAT(test::filesUnder(scratch_.path()),
                UnorderedElementsAre(Pair("out/new", two), Pair("out/notes.txt", one),
                                     Pair("out/mine/deep/a", one)));
    EXPECT_THAT(namesIn(scratch_.path()), UnorderedElementsAre("out"));
  }
}

TEST_F(OldStack, KeepsEverythingWhereItsOwnFilesBecomeUnknown) {
  StagedOutput output(scratch_ / "out", Kind::folder,
                      [](const fs::path&) -> std::set<std::string> { throw UsageError("?"); });
  output.write("new", two);
  output.commit();
  EXPECT_THAT(
      test::filesUnder(scratch_.path()),
      UnorderedElementsAre(Pair("out/new", two), Pair("out/old", one), Pair("out/white/old", one)));
}

TEST_F(OldStack, IsReplacedWithoutAnExchange) {
  exchanges = false;
  replace();
  EXPECT_THAT(test::filesUnder(scratch_.path()), UnorderedElementsAre(Pair("out/new", two)));
  EXPECT_THAT(namesIn(scratch_.path()), UnorderedElementsAre("out"));
}

TEST_F(OldStack, ThatCannotBeReplacedStaysAndTheNewOneIsKeptBesideIt) {
  exchanges = false;
  rename_that_fails = (scratch_ / "out").string();
  const std::string name = (scratch_ / "out").string();
  EXPECT_THAT(
      [&] { replace(); },
      ThrowsMessage<DataError>("cannot replace '" + name +
                               "': Invalid cross-device link; the new one is '" + name + ".new'"));
  EXPECT_THAT(namesIn(scratch_.path()), UnorderedElementsAre("out", "out.new"));
  EXPECT_EQ(test::filesUnder(scratch_ / "out").size(), 2U);
  EXPECT_THAT(test::filesUnder(scratch_ / "out.new"), UnorderedElementsAre(Pair("new", two)));
  EXPECT_THAT([&] { replace(); },
              ThrowsMessage<DataError>("cannot replace '" + name + "': Invalid cross-device link"));
  EXPECT_THAT(namesIn(scratch_.path()), UnorderedElementsAre("out", "out.new"));
}

TEST_F(OldStack, IsPutBackAfterARunThatWasKilledBetweenTwoRenames) {
  const auto before = test::filesUnder(scratch_.path());
  inAnotherProcess([&] {
    exchanges = false;
    renames_to_live = 1;
    replace();
  });
  ASSERT_FALSE(fs::exists(scratch_ / "out"));
  std::vector<std::string> warnings;
  const auto warn = [&](const std::string& text) { warnings.push_back(text); };
  EXPECT_THAT([&] { StagedOutput::checkFolder(scratch_ / "out", false, ownFiles, warn); },
              ThrowsMessage<UsageError>(testing::HasSubstr("exists; --overwrite replaces it")));
  EXPECT_THAT(warnings,
              testing::ElementsAre("'" + (scratch_ / "out").string() +
                                   "' was being replaced when a run was killed; the folder before "
                                   "it is put back"));
  EXPECT_EQ(test::filesUnder(scratch_ / "out").size(), before.size());
  EXPECT_EQ(refusal(), "");
  replace();
  EXPECT_THAT(test::filesUnder(scratch_.path()), UnorderedElementsAre(Pair("out/new", two)));
  EXPECT_THAT(namesIn(scratch_.path()), UnorderedElementsAre("out"));
}

TEST_F(OldStack, SurvivesARunThatIsKilledBeforeOrAfterTheRenames) {
  for (const int renames : {0, 2}) {
    const auto before = test::filesUnder(scratch_ / "out");
    inAnotherProcess([&] {
      exchanges = false;
      renames_to_live = renames;
      replace();
      renames_to_live = 0;
    });
    EXPECT_EQ(test::filesUnder(scratch_ / "out") == before, renames == 0);
  }
}

TEST(StagedOutput, WhatAnotherRunHasWrittenMeanwhileIsNotReplacedUnasked) {
  const test::ScratchFolder scratch;
  const auto late = [&](const std::string& name, Kind kind, bool overwrite) {
    const fs::path path = scratch / name;
    StagedOutput::check(path, kind, overwrite);
    StagedOutput output(path, kind);
    // Another run is the first to give its output the name.
    if (kind == Kind::folder) {
      output.write("slice", two);
      fs::create_directory(path);
      put(path / "slice", one);
    } else {
      put(output.path(), two);
      put(path, one);
    }
    output.commit();
  };
  for (const bool exchange : {true, false}) {
    exchanges = exchange;
    const std::string tag = exchange ? "a" : "b";
    for (const auto& [name, kind, file] :
         {std::tuple("file", Kind::file, ""), {"folder", Kind::folder, "/slice"}}) {
      const std::string kept = name + tag;
      const auto commit = [&, kind = kind] { late(kept, kind, false); };
      EXPECT_THAT(commit, ThrowsMessage<DataError>("cannot replace '" + (scratch / kept).string() +
                                                   "': File exists; the new one is '" +
                                                   (scratch / kept).string() + ".new'"));
      const auto files = test::filesUnder(scratch.path());
      EXPECT_EQ(files.at(kept + file), one);
      EXPECT_EQ(files.at(kept + ".new" + file), two);
      const std::string replaced = name + tag + "-replaced";
      late(replaced, kind, true);
      EXPECT_EQ(test::filesUnder(scratch.path()).at(replaced + file), two);
    }
  }
  exchanges = true;
}

TEST(StagedOutput, NamesMayBeAsLongAsTheFileSystemAllows) {
  const test::ScratchFolder scratch;
  std::string umlauts;
  for (int i = 0; i < 127; ++i) umlauts += "ä";
  const std::string letters(255, 'a');
  for (const std::string& name : {letters, umlauts}) {
    StagedOutput::check(scratch / name, Kind::file, false);
    StagedOutput file(scratch / name, Kind::file);
    EXPECT_LT(file.path().filename().string().size(), 100U);
    put(file.path(), one);
    file.commit();
  }
  const std::string other = std::string(254, 'a') + "b";
  EXPECT_NE(stagingPath(scratch / letters), stagingPath(scratch / other));
  StagedOutput folder(scratch / other, Kind::folder);
  folder.write(letters + "/" + letters, two);
  folder.commit();
  EXPECT_THAT(test::filesUnder(scratch.path()),
              UnorderedElementsAre(Pair(letters, one), Pair(umlauts, one),
                                   Pair(other + "/" + letters + "/" + letters, two)));
  EXPECT_THAT([&] { StagedOutput::check(scratch / (letters + "a"), Kind::file, false); },
              ThrowsMessage<UsageError>(testing::HasSubstr(": a name has at most 255 bytes")));
}

TEST(StagedOutput, WritesBelowItsFolderOnlyAndEachFileOnce) {
  const test::ScratchFolder scratch;
  const StagedOutput output(scratch / "out", Kind::folder);
  const std::string shown = "cannot write '" + (scratch / "out").string();
  const auto writing = [&](const std::string& name) {
    return [&, name] { output.write(name, one); };
  };
  EXPECT_THAT(writing("../x"),
              ThrowsMessage<DataError>(shown + "/../x': the name has a folder whose name is '..'"));
  EXPECT_THAT(writing((scratch / "x").string()),
              ThrowsMessage<DataError>(testing::HasSubstr("the name is an absolute path")));
  EXPECT_THAT(writing(".."), ThrowsMessage<DataError>(shown + "/..': the name is '..'"));
  output.write("a/b", one);
  EXPECT_THAT(writing("a/b"), ThrowsMessage<DataError>(shown + "/a/b': File exists"));
  fs::create_symlink(scratch / "victim", output.path() / "link");
  EXPECT_THAT(writing("link"), ThrowsMessage<DataError>(shown + "/link': File exists"));
  EXPECT_EQ(namesIn(scratch.path()).size(), 1U);
}

TEST(StagedOutput, IsNotCommittedAfterASignal) {
  const test::ScratchFolder scratch;
  const pid_t child = fork();
  if (child == 0) {
    noteInterrupts();
    int code = 1;
    try {
      StagedOutput file(scratch / "new", Kind::file);
      put(file.path(), two);
      std::raise(SIGTERM);
      file.commit();
    } catch (const Interrupted& error) {
      code = error.signal() == SIGTERM ? 0 : 2;
    }
    _exit(code);
  }
  int status = 0;
  waitpid(child, &status, 0);
  EXPECT_EQ(status, 0);
  EXPECT_THAT(test::filesUnder(scratch.path()), IsEmpty());
}

TEST(StagedOutput, AfterAbandonAllNothingRemainsAndNothingIsCommitted) {
  const test::ScratchFolder scratch;
  put(scratch / "old", one);
  // A process of its own, for no output can be committed in it afterwards.
  const pid_t child = fork();
  if (child == 0) {
    StagedOutput folder(scratch / "out", Kind::folder);
    folder.write("deep/er/a", one);
    StagedOutput file(scratch / "old", Kind::file);
    put(file.path(), two);
    StagedOutput unwritten(scratch / "new", Kind::file);
    StagedOutput::abandonAll(std::chrono::milliseconds(100));
    std::thread([&] { folder.write("deep/er/b", one); }).detach();
    std::thread([&] { file.commit(); }).detach();
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
    _exit(0);
  }
  int status = 0;
  waitpid(child, &status, 0);
  EXPECT_EQ(status, 0);
  EXPECT_THAT(test::filesUnder(scratch.path()), UnorderedElementsAre(Pair("old", one)));
  EXPECT_EQ(std::distance(fs::directory_iterator(scratch.path()), {}), 1);
}

TEST_F(OldStack, KeepsFilesOfOthersWhereTheRunIsAbandonedWhileItIsReplaced) {
  const pid_t child = fork();
  if (child == 0) {
    StagedOutput output(scratch_ / "out", Kind::folder,
                        [](const fs::path&) -> std::set<std::string> {
                          std::thread([] {
                            StagedOutput::abandonAll(std::chrono::milliseconds(10));
                            _exit(0);
                          }).join();
                          return {};
                        });
    output.write("new", two);
    put(scratch_ / "out/notes.txt", one);
    output.commit();
    _exit(1);
  }
  int status = 0;
  waitpid(child, &status, 0);
  EXPECT_EQ(status, 0);
  const auto files = test::filesUnder(scratch_.path());
  EXPECT_TRUE(std::any_of(files.begin(), files.end(),
                          [](const auto& file) { return file.first.ends_with("/notes.txt"); }));
}

TEST(StagedOutput, RefusesBeforeAnyWork) {
  const test::ScratchFolder scratch;
  fs::create_directory(scratch / "empty");
  fs::create_directory(scratch / "full");
  put(scratch / "full/file", one);
  const auto refusal = [&](const std::string& name, Kind kind, bool overwrite) {
    try {
      StagedOutput::check(scratch / name, kind, overwrite);
    } catch (const UsageError& error) {
      std::string text = error.what();
      for (std::size_t at; (at = text.find(scratch.path().string())) != std::string::npos;) {
        text.replace(at, scratch.path().string().size(), "TMP");
      }
      return text;
    }
    return std::string();
  };
  EXPECT_EQ(refusal("new", Kind::folder, false), "");
  EXPECT_EQ(refusal("new/", Kind::folder, false), "");
  EXPECT_EQ(refusal("new", Kind::file, false), "");
  EXPECT_EQ(refusal("empty", Kind::folder, false), "");
  EXPECT_EQ(refusal("full", Kind::folder, true), "");
  EXPECT_EQ(refusal("full/file", Kind::file, true), "");
  EXPECT_EQ(refusal("full", Kind::folder, false), "'TMP/full' exists; --overwrite replaces it");
  EXPECT_EQ(refusal("full/file", Kind::file, false),
            "'TMP/full/file' exists; --overwrite replaces it");
  EXPECT_EQ(refusal("full/file", Kind::folder, true), "'TMP/full/file' exists and is not a folder");
  EXPECT_EQ(refusal("full", Kind::file, true), "'TMP/full' is a folder; name a file in it");
  EXPECT_EQ(refusal("no/new", Kind::file, false),
            "cannot write to 'TMP/no/new': there is no folder 'TMP/no'");
  for (const std::string name : {"", ".", "..", "/", "../.."}) {
    EXPECT_THAT([&] { StagedOutput::check(name, Kind::folder, true); },
                ThrowsMessage<UsageError>("cannot write to '" + name +
                                          "': give a folder or file a name of its own"));
  }
  EXPECT_THAT([] { StagedOutput::check("/proc", Kind::folder, true); },
              ThrowsMessage<UsageError>(
                  "'/proc' is a mount point, which cannot be replaced; name something in it"));
  const fs::path here = fs::current_path();
  fs::current_path(scratch / "empty");
  EXPECT_THAT([] { StagedOutput::check("../empty", Kind::folder, true); },
              ThrowsMessage<UsageError>("'../empty' is the current folder, which cannot be "
                                        "replaced; go to another one"));
  fs::current_path(here);
  EXPECT_THAT([] { StagedOutput::check("/dev/null", Kind::file, true); },
              ThrowsMessage<UsageError>("'/dev/null' is not an ordinary file"));
}

TEST(StagedOutput, RefusesNamesOfDescriptors) {
  const test::ScratchFolder scratch;
  fs::create_symlink("/dev/stdout", scratch / "link");
  for (const std::string& name : {std::string("/dev/stdout"), std::string("/dev/fd/1"),
                                  std::string("/proc/self/fd/2"), std::string(scratch / "link")}) {
    EXPECT_THAT([&] { StagedOutput::check(name, Kind::file, true); },
                ThrowsMessage<UsageError>("'" + name +
                                          "' stands for an open file of the program; name the "
                                          "file itself"));
  }
}

TEST(StagedOutput, ATargetIsWrittenOnceAtATime) {
  const test::ScratchFolder scratch;
  fs::create_symlink("a.vdb", scratch / "link.vdb");
  const auto written = ThrowsMessage<UsageError>(EndsWith("is written by another step already"));
  {
    StagedOutput output(scratch / "a.vdb", Kind::file);
    put(output.path(), one);
    for (const fs::path& path : {scratch / "a.vdb", scratch / "./a.vdb", scratch / "link.vdb"}) {
      EXPECT_THAT([&] { StagedOutput::check(path, Kind::file, true); }, written);
      EXPECT_THAT([&] { StagedOutput(path, Kind::file); }, written);
    }
    output.commit();
  }
  StagedOutput::check(scratch / "a.vdb", Kind::file, true);
  EXPECT_THAT(test::filesUnder(scratch.path()), UnorderedElementsAre(Pair("a.vdb", one)));
}

TEST(StagedOutput, AFullDiskIsAnError) {
  EXPECT_THAT([] { writeFile("/dev/full", two, "out/slice_1.png"); },
              ThrowsMessage<DataError>("cannot write 'out/slice_1.png': No space left on device"));
}

TEST(StagedOutput, AFolderThatVanishedIsAnErrorNamingTheFile) {
  const test::ScratchFolder scratch;
  const StagedOutput output(scratch / "out", Kind::folder);
  fs::remove_all(output.path());
  EXPECT_THAT([&] { output.write("a", one); },
              ThrowsMessage<DataError>("cannot write '" + (scratch / "out/a").string() +
                                       "': No such file or directory"));
}

}  // namespace
}  // namespace vdbdither
