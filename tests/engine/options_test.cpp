#include "vdbdither/engine/options.h"

#include <cmath>

#include <gtest/gtest.h>

#include "vdbdither/model/errors.h"

namespace vdbdither {
namespace {

using Words = std::vector<std::string>;

/// What `words` are refused with; empty where they are taken.
std::string refusal(const Options& options, const Words& words, const Options& common = {}) {
  try {
    options.parse(words, common);
  } catch (const UsageError& error) {
    return error.what();
  }
  return "";
}

struct Example {
  bool strict = false;
  int count = 3;
  double amplitude = 4;
  double band_mm = 0;
  std::string mask = "blue";
  std::string file;
  openvdb::Vec3d angles{0.0};
  Options options;

  Example() {
    options.positional("file", file, "the file");
    options.flag("strict", strict, "refuse repairs");
    options.integer("count", count, 1, 9, "how many");
    options.number("amplitude", amplitude, 0, 8, "the constant");
    options.length("band", band_mm, "the band");
    options.choice("mask", mask, {"blue", "white"}, "the mask");
    options.triple("rotate", angles, "X,Y,Z", "degrees");
  }
};

TEST(Options, ReadsEveryKindOfValue) {
  Example example;
  example.options.parse(Words{"part.stl", "--strict", "--count", "5", "--amplitude=2.5", "--band",
                              "42um", "--mask", "white", "--rotate", "-90,0,4.5"});
  EXPECT_EQ(example.file, "part.stl");
  EXPECT_TRUE(example.strict);
  EXPECT_EQ(example.count, 5);
  EXPECT_EQ(example.amplitude, 2.5);
  EXPECT_EQ(example.band_mm, 0.042);
  EXPECT_EQ(example.mask, "white");
  EXPECT_EQ(example.angles, openvdb::Vec3d(-90, 0, 4.5));
}

TEST(Options, CanonicalTextLeavesDefaultsOutAndReadsBack) {
  Example example;
  EXPECT_EQ(example.options.canonical(), "");
  example.options.parse(
      Words{"--rotate", "30", "my part.stl", "--band=0.1", "--strict", "--count", "3"});
  EXPECT_EQ(example.options.canonical(), "'my part.stl' --strict --band 0.1mm --rotate 30,30,30");
}

TEST(Options, RefusalsSayWhatWouldHaveBeenAccepted) {
  const Example example;
  EXPECT_EQ(refusal(example.options, {"a", "--count", "12"}),
            "--count: '12' is not a whole number between 1 and 9");
  EXPECT_EQ(refusal(example.options, {"a", "--count", "2.5"}),
            "--count: '2.5' is not a whole number between 1 and 9");
  EXPECT_EQ(refusal(example.options, {"a", "--amplitude", "9"}),
            "--amplitude: '9' is not a number between 0 and 8");
  EXPECT_EQ(refusal(example.options, {"a", "--amplitude", "nan"}),
            "--amplitude: 'nan' is not a number between 0 and 8");
  EXPECT_EQ(refusal(example.options, {"a", "--mask", "pink"}),
            "--mask: 'pink' is none of blue, white");
  EXPECT_EQ(refusal(example.options, {"a", "--band", "2 parsec"}),
            "--band: '2 parsec' is not a length such as 0.042mm, 42um or 600dpi");
  EXPECT_EQ(refusal(example.options, {"a", "--rotate", "1,2"}),
            "--rotate: '1,2' is not three numbers such as 0,45,90, or one for all three");
  EXPECT_EQ(refusal(example.options, {"a", "b"}), "unexpected argument 'b'; see --help");
  EXPECT_EQ(refusal(Example().options, {}), "no file is given; see --help");
}

TEST(Options, UnknownOptionNamesTheNearest) {
  const Example example;
  EXPECT_EQ(refusal(example.options, {"a", "--amplitud", "2"}),
            "no option '--amplitud'; did you mean '--amplitude'?");
  EXPECT_EQ(refusal(example.options, {"a", "--zzzzzzzz"}), "no option '--zzzzzzzz'; see --help");
}

TEST(Options, CommonOptionsYieldToTheOperatorsOwn) {
  Example example;
  Options common;
  int count_of_run = 0;
  int threads = 0;
  common.integer("count", count_of_run, 0, 100, "another count");
  common.integer("threads", threads, 0, 64, "threads");
  example.options.parse(Words{"a", "--count", "2", "--threads", "4"}, common);
  EXPECT_EQ(example.count, 2);
  EXPECT_EQ(count_of_run, 0);
  EXPECT_EQ(threads, 4);
}

TEST(Options, LengthsHaveUnits) {
  EXPECT_EQ(parseLengthMm("0.042"), 0.042);
  EXPECT_EQ(parseLengthMm("0.042mm"), 0.042);
  EXPECT_EQ(parseLengthMm("42um"), 0.042);
  EXPECT_EQ(parseLengthMm("42µm"), 0.042);
  EXPECT_EQ(parseLengthMm("1.5cm"), 15);
  EXPECT_EQ(parseLengthMm("2m"), 2000);
  EXPECT_EQ(parseLengthMm("1in"), 25.4);
  EXPECT_EQ(parseLengthMm("600dpi"), 25.4 / 600);
  for (const char* text : {"", "mm", "dpi", "0dpi", "-300dpi", "1e400", "inf", "4 2um", "42xm"}) {
    EXPECT_THROW(parseLengthMm(text), UsageError) << text;
  }
}

TEST(Options, HelpShowsEveryOptionWithItsDefault) {
  const Example example;
  const std::string help = example.options.help("example", "does things", "example part.stl", {});
  for (const char* part : {"does things", "--amplitude X [4]", "--mask blue|white [blue]",
                           "--strict", "--band LENGTH", "vdbdither example part.stl"}) {
    EXPECT_NE(help.find(part), std::string::npos) << part << "\n" << help;
  }
}

TEST(Options, NearestWordIsSilentWhereNoneIsNear) {
  const Words words{"dither", "normals", "slice-export"};
  EXPECT_EQ(nearestWord("dihter", words), "dither");
  EXPECT_EQ(nearestWord("slice-exprot", words), "slice-export");
  EXPECT_EQ(nearestWord("banana", words), "");
}

TEST(Options, AnOptionThatRepeatsTakesOneWordEachTime) {
  Options options;
  std::vector<std::string> holes;
  std::string file;
  options.texts("hole", holes, "X", "Holes");
  options.positional("file", file, "A file");
  options.parse(Words{"--hole", "a b", "part", "--hole=c"});
  EXPECT_EQ(holes, (std::vector<std::string>{"a b", "c"}));
  EXPECT_EQ(file, "part");
  EXPECT_EQ(options.canonical(), "--hole 'a b' --hole c part");
}

}  // namespace
}  // namespace vdbdither
