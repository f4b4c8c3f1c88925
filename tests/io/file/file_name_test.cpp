#include "io/file/file_name.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace vdbdither {
namespace {

using testing::Eq;
using testing::Optional;

TEST(FileName, IsOneComponentOfPrintableUtf8) {
  for (const char* name : {"white", "Vero PureWht", "a.b", ".hidden", "...", "-", "50%",
                           "C:", "weiß", "白", "\xf0\x9f\x8e\xa8", " ", "\xc3\xa9"}) {
    EXPECT_EQ(fileNameProblem(name), std::nullopt) << name;
  }
  EXPECT_EQ(fileNameProblem(std::string(255, 'a')), std::nullopt);
}

TEST(FileName, RefusesWhatLeavesTheFolder) {
  EXPECT_THAT(fileNameProblem(""), Optional(Eq("is empty")));
  EXPECT_THAT(fileNameProblem("."), Optional(Eq("is '.'")));
  EXPECT_THAT(fileNameProblem(".."), Optional(Eq("is '..'")));
  EXPECT_THAT(fileNameProblem("../x"), Optional(Eq("contains '/'")));
  EXPECT_THAT(fileNameProblem("/etc"), Optional(Eq("contains '/'")));
  EXPECT_THAT(fileNameProblem("a\\b"), Optional(Eq("contains '\\'")));
}

TEST(FileName, RefusesWhatDoesNotPrint) {
  EXPECT_THAT(fileNameProblem(std::string_view("a\0b", 3)),
              Optional(Eq("contains the unprintable character U+0000")));
  EXPECT_THAT(fileNameProblem("a\nb"), Optional(Eq("contains the unprintable character U+000A")));
  EXPECT_THAT(fileNameProblem("\x1b[31m"),
              Optional(Eq("contains the unprintable character U+001B")));
  EXPECT_THAT(fileNameProblem("\x7f"), Optional(Eq("contains the unprintable character U+007F")));
  EXPECT_THAT(fileNameProblem("\xc2\x85"),
              Optional(Eq("contains the unprintable character U+0085")));
  EXPECT_THAT(fileNameProblem("a\xe2\x80\xaegnp.exe"),
              Optional(Eq("contains the unprintable character U+202E")));
}

TEST(FileName, RefusesWhatIsNotUtf8) {
  for (const char* name : {"caf\xe9", "\x80", "\xc0\xaf", "\xe0\x80\xaf", "\xed\xa0\x80",
                           "\xf4\x90\x80\x80", "\xf8\x88\x80\x80\x80", "\xe2\x82", "\xff"}) {
    EXPECT_THAT(fileNameProblem(name), Optional(Eq("is not UTF-8"))) << name;
  }
}

TEST(FileName, RefusesWhatIsTooLong) {
  EXPECT_THAT(fileNameProblem(std::string(256, 'a')),
              Optional(Eq("has 256 bytes; the maximum is 255")));
}

TEST(FileName, APathBelowAFolderConsistsOfNames) {
  for (const char* path : {"slice_00000.png", "white/slice_00000.png", "a/b/c"})
    EXPECT_EQ(relativePathProblem(path), std::nullopt) << path;
  EXPECT_THAT(relativePathProblem("/tmp/x"), Optional(Eq("is an absolute path")));
  EXPECT_THAT(relativePathProblem("../x"), Optional(Eq("has a folder whose name is '..'")));
  EXPECT_THAT(relativePathProblem("a/../../x"), Optional(Eq("has a folder whose name is '..'")));
  EXPECT_THAT(relativePathProblem("a/./x"), Optional(Eq("has a folder whose name is '.'")));
  EXPECT_THAT(relativePathProblem("a//x"), Optional(Eq("has a folder whose name is empty")));
  EXPECT_THAT(relativePathProblem("a/.."), Optional(Eq("is '..'")));
  EXPECT_THAT(relativePathProblem("a/"), Optional(Eq("is empty")));
  EXPECT_THAT(relativePathProblem(""), Optional(Eq("is empty")));
  EXPECT_THAT(relativePathProblem("C:\\x"), Optional(Eq("contains '\\'")));
}

TEST(FileName, WhatLiesWithinAFolderIsSeenByTheNames) {
  EXPECT_TRUE(liesWithin("job", "job"));
  EXPECT_TRUE(liesWithin("job/", "./job"));
  EXPECT_TRUE(liesWithin("job/a/b", "job"));
  EXPECT_TRUE(liesWithin("x/../job/a", "job/"));
  EXPECT_FALSE(liesWithin("jobs", "job"));
  EXPECT_FALSE(liesWithin("job", "job/a"));
  EXPECT_FALSE(liesWithin("job/../a", "job"));
}

}  // namespace
}  // namespace vdbdither
