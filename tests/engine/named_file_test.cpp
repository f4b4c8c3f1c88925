#include "vdbdither/engine/named_file.h"

#include <fstream>
#include <sys/stat.h>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/scratch_folder.h"
#include "vdbdither/engine/registry.h"
#include "vdbdither/engine/run_options.h"
#include "vdbdither/model/errors.h"

namespace vdbdither {
namespace {

using testing::ThrowsMessage;
using Words = std::vector<std::string>;

/// The file that `words`, behind the verb, name as the input of a chain; `words` become the rest.
std::string taken(const std::string& verb, Words& words) {
  const OperatorInfo& info = findOperator(verb);
  const std::unique_ptr<Operator> made = info.make();
  Options own;
  made->declare(own);
  RunOptions run_options;
  Options common;
  run_options.declare(common);
  return takeNamedFile(words, info, own, common);
}

std::pair<std::string, Words> split(const std::string& verb, Words words) {
  const std::string file = taken(verb, words);
  return {file, words};
}

using Split = std::pair<std::string, Words>;

TEST(NamedFile, AVdbBehindAFilterIsItsInput) {
  EXPECT_EQ(split("normals", {"a.vdb", "-o", "b.vdb"}), Split("a.vdb", {"-o", "b.vdb"}));
  EXPECT_EQ(split("normals", {"-o", "b.vdb"}), Split("", {"-o", "b.vdb"}));
  EXPECT_EQ(split("normals", {}), Split("", {}));
}

TEST(NamedFile, TheValuesOfOptionsAreNoWords) {
  EXPECT_EQ(split("normals", {"-o", "b.vdb", "a.vdb"}), Split("a.vdb", {"-o", "b.vdb"}));
  EXPECT_EQ(split("csg", {"--union", "b.vdb"}), Split("", {"--union", "b.vdb"}));
  EXPECT_EQ(split("csg", {"--union", "b.vdb", "a.vdb"}), Split("a.vdb", {"--union", "b.vdb"}));
  EXPECT_EQ(split("csg", {"--union=b.vdb", "a.vdb"}), Split("a.vdb", {"--union=b.vdb"}));
  EXPECT_EQ(split("info", {"--json", "a.vdb"}), Split("a.vdb", {"--json"}));
  EXPECT_EQ(split("normals", {"-qo", "b.vdb", "a.vdb"}), Split("a.vdb", {"-qo", "b.vdb"}));
}

TEST(NamedFile, TheInputStandsBeforeTheOperatorsOwnWords) {
  EXPECT_EQ(split("slice-export", {"a.vdb", "out"}), Split("a.vdb", {"out"}));
  EXPECT_EQ(split("slice-export", {"out"}), Split("", {"out"}));
  EXPECT_EQ(split("mesh-export", {"a.vdb", "a.stl"}), Split("a.vdb", {"a.stl"}));
}

TEST(NamedFile, AVdbAloneIsTheInputUnlessTheOperatorsOwnWordIsAVdb) {
  EXPECT_EQ(split("slice-export", {"a.vdb"}), Split("a.vdb", {})) << "and the folder is missing";
  EXPECT_EQ(split("write", {"b.vdb"}), Split("", {"b.vdb"}));
  EXPECT_EQ(split("write", {"a.vdb", "b.vdb"}), Split("a.vdb", {"b.vdb"}));
  EXPECT_EQ(split("compare", {"b.vdb"}), Split("", {"b.vdb"}));
  EXPECT_EQ(split("compare", {"a.vdb", "b.vdb"}), Split("a.vdb", {"b.vdb"}));
}

TEST(NamedFile, AnyFileOrPipeIsTheInputIfThereIsAWordTooMany) {
  const test::ScratchFolder scratch;
  const std::string pipe = scratch / "pipe";
  ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
  EXPECT_EQ(split("stats", {pipe}), Split(pipe, {}));
  EXPECT_EQ(split("compare", {pipe, "b.vdb"}), Split(pipe, {"b.vdb"}));
  EXPECT_EQ(split("compare", {pipe}), Split("", {pipe})) << "compared with what comes";
  EXPECT_EQ(split("info", {"-"}), Split("-", {}));
  EXPECT_EQ(split("normals", {"typo"}), Split("", {"typo"})) << "for the options to refuse";
}

TEST(NamedFile, AnOperatorWorksOnAFileOnlyIfItIsTheWholeCommandLine) {
  const test::ScratchFolder scratch;
  const std::string file = scratch / "a.vdb";
  std::ofstream(file) << "x";
  const auto works = [](const std::string& verb, const Words& words) {
    return worksOnFile(findOperator(verb), words);
  };
  EXPECT_TRUE(works("info", {file}));
  EXPECT_TRUE(works("info", {"--json", file}));
  EXPECT_FALSE(works("info", {}));
  EXPECT_FALSE(works("info", {"gone.vdb"})) << "for `read` to refuse";
  EXPECT_FALSE(works("info", {file, "--help"}));
  EXPECT_TRUE(works("measure", {"a.stl", "--reference", "b.stl"}));
  EXPECT_FALSE(works("measure", {"--reference", "b.stl"}));
  EXPECT_FALSE(works("measure", {"a.vdb", "--reference", "b.stl"}));
  EXPECT_TRUE(works("render", {"a.stl", "a.png"}));
  EXPECT_FALSE(works("render", {"a.png"}));
  EXPECT_FALSE(works("render", {"a.vdb", "a.png"}));
  EXPECT_FALSE(works("normals", {file})) << "it has no tool";

  const OperatorInfo& measure = findOperator("measure");
  EXPECT_THAT([&] { refuseNamedFile(measure, "a.stl", false); },
              ThrowsMessage<UsageError>("measure: works on 'a.stl' only if it is the whole command "
                                        "line, not in a chain"));
  EXPECT_THAT(
      [&] { refuseNamedFile(measure, "a.vdb", true); },
      ThrowsMessage<UsageError>("measure: takes the slabs of the stage before it and cannot "
                                "read 'a.vdb' as well"));
  EXPECT_NO_THROW(refuseNamedFile(measure, "a.vdb", false));
}

}  // namespace
}  // namespace vdbdither
