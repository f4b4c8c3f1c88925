#include "io/file/staged_output.h"

#include <csignal>
#include <fstream>
#include <optional>
#include <thread>
#include <unistd.h>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/scratch_folder.h"
#include "vdbdither/model/errors.h"
#include "vdbdither/model/interrupt.h"

namespace vdbdither {
namespace {

namespace fs = std::filesystem;
using Kind = StagedOutput::Kind;
using testing::IsEmpty;
using testing::Pair;
using testing::ThrowsMessage;
using testing::UnorderedElementsAre;

const std::vector<std::uint8_t> one = {1};
const std::vector<std::uint8_t> two = {2, 2};

void put(const fs::path& path, const std::vector<std::uint8_t>& bytes) {
  writeFile(path, bytes, path);
}

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
  StagedOutput folder(scratch / "out/", Kind::folder);
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
  const pid_t dead = fork();
  if (dead == 0) _exit(0);
  int status = 0;
  waitpid(dead, &status, 0);
  fs::create_directory(scratch / (".out.partial-" + std::to_string(dead)));
  put(scratch / (".out.partial-" + std::to_string(dead)) / "half", one);
  put(scratch / (".out.partial-" + std::to_string(getppid())), one);
  put(scratch / ".out.partial-mine", one);
  StagedOutput(scratch / "out", Kind::folder).commit();
  EXPECT_THAT(test::filesUnder(scratch.path()),
              UnorderedElementsAre(Pair(".out.partial-" + std::to_string(getppid()), one),
                                   Pair(".out.partial-mine", one)));
}

TEST(StagedOutput, RemovesWhatBelongsToAPartialOutputOfAKilledRun) {
  const test::ScratchFolder scratch;
  const pid_t dead = fork();
  if (dead == 0) _exit(0);
  int status = 0;
  waitpid(dead, &status, 0);
  for (const std::string name : {"", ".old", "-faces"})
    put(scratch / (".out.partial-" + std::to_string(dead) + name), one);
  StagedOutput(scratch / "out", Kind::file);
  EXPECT_THAT(test::filesUnder(scratch.path()), IsEmpty());
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
  EXPECT_THAT([] { StagedOutput::check("/dev/null", Kind::file, true); },
              ThrowsMessage<UsageError>("'/dev/null' is not an ordinary file"));
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
