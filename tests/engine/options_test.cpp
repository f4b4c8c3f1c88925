#include "vdbdither/engine/options.h"

#include <gtest/gtest.h>

#include "vdbdither/engine/chain.h"
#include "vdbdither/model/errors.h"

namespace vdbdither {
namespace {

using openvdb::Coord;
using openvdb::Vec3d;
using Words = std::vector<std::string>;

enum class Colour { red, green, blue };
constexpr std::array<Choice<Colour>, 3> colours{{{Colour::red, "red", "Like a rose"},
                                                 {Colour::green, "green", "Like grass"},
                                                 {Colour::blue, "blue", "Like the sky"}}};

/// What `words` are refused with; empty where they are accepted.
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
  double band_mm = 0.5;
  std::optional<double> fit_mm;
  std::optional<double> gain;
  Colour colour = Colour::blue;
  Colour mask = Colour::red;
  std::string mask_file;
  std::string file;
  std::string prefix = "slice_";
  Vec3d angles{0.0};
  Coord size{8, 8, 8};
  std::optional<Vec3d> pitch_mm;
  Options options;

  Example() {
    options.positional("file", file, "The file");
    options.flag("strict", strict, "Refuses repairs");
    options.letter('s');
    options.integer("count", count, {1, 9}, "How many");
    options.letter('c');
    options.number("amplitude", amplitude, {0, 8}, "The constant");
    options.length("band", band_mm, {0.01, 1}, "The band");
    options.length("fit", fit_mm, Range::above(0, 1000), "The longest axis");
    options.number("gain", gain, Range::above(0), "The gain", {"auto", "As the input needs"});
    options.choice("colour", colour, colours, "The colour");
    options.choiceOrFile("mask", mask, std::array{colours[0], colours[1]}, Colour::blue, mask_file,
                         "FILE.vdb", "The mask");
    options.text("prefix", prefix, "TEXT", "The prefix");
    options.triple("rotate", angles, "X,Y,Z", {-360, 360}, "Degrees");
    options.triple("size", size, "N", {1, 256}, "Voxels");
    options.lengths("pitch", pitch_mm, "DX,DY,DZ", {0.001, 10}, "The pitch");
  }
};

TEST(Options, EveryKindOfValueIsRead) {
  Example example;
  example.options.parse(Words{"part.stl",  "--strict", "--count",  "5",      "--amplitude=2.5",
                              "--band",    "42um",     "--colour", "green",  "--rotate",
                              "-90,0,4.5", "--fit",    "3cm",      "--gain", "2",
                              "--size",    "1,2,3",    "--pitch",  "50um",   "--prefix",
                              "",          "--mask",   "a.vdb"});
  EXPECT_EQ(example.file, "part.stl");
  EXPECT_TRUE(example.strict);
  EXPECT_EQ(example.count, 5);
  EXPECT_EQ(example.amplitude, 2.5);
  EXPECT_EQ(example.band_mm, 0.042);
  EXPECT_EQ(example.colour, Colour::green);
  EXPECT_EQ(example.angles, Vec3d(-90, 0, 4.5));
  EXPECT_EQ(example.fit_mm, 30);
  EXPECT_EQ(example.gain, 2);
  EXPECT_EQ(example.size, Coord(1, 2, 3));
  EXPECT_EQ(example.pitch_mm, Vec3d(0.05));
  EXPECT_EQ(example.prefix, "");
  EXPECT_EQ(example.mask, Colour::blue);
  EXPECT_EQ(example.mask_file, "a.vdb");
  example.options.parse(Words{"part.stl", "--gain", "auto", "--mask", "green"});
  EXPECT_EQ(example.gain, std::nullopt);
  EXPECT_EQ(example.mask, Colour::green);
}

TEST(Options, LettersJoinTheirValuesAndEachOther) {
  Example example;
  example.options.parse(Words{"-sc5", "part.stl"});
  EXPECT_TRUE(example.strict);
  EXPECT_EQ(example.count, 5);
  example.options.parse(Words{"-c", "7", "part.stl"});
  EXPECT_EQ(example.count, 7);
}

TEST(Options, AFileNameIsTakenAsItStands) {
  Example example;
  for (const std::string name : {"[part,one]", "++", "-", "{a}", "%%", "a=b", "x\ny"}) {
    example.options.parse(Words{name});
    EXPECT_EQ(example.file, name);
  }
  example.options.parse(Words{"--", "--strict"});
  EXPECT_EQ(example.file, "--strict");
  EXPECT_FALSE(example.strict);
}

TEST(Options, TheLastOfSeveralValuesCounts) {
  Example example;
  example.options.parse(Words{"--count", "2", "part.stl", "--count", "4"});
  EXPECT_EQ(example.count, 4);
}

TEST(Options, CanonicalTextHoldsEveryValueAndReadsBack) {
  Example example;
  const std::string defaults =
      "--count 3 --amplitude 4 --band 0.5mm --gain auto --colour blue --mask red --prefix slice_ "
      "--rotate 0,0,0 --size 8,8,8";
  EXPECT_EQ(example.options.canonical(), defaults);
  example.options.parse(Words{"--rotate", "30", "my part.stl", "--band=0.1", "--strict", "--fit",
                              "1in", "--pitch", "42um,84um,22um", "--prefix", "", "--mask",
                              "it's.vdb"});
  const std::string canonical = example.options.canonical();
  EXPECT_EQ(canonical,
            "'my part.stl' --strict --count 3 --amplitude 4 --band 0.1mm --fit 25.4mm --gain auto "
            "--colour blue --mask 'it'\\''s.vdb' --prefix '' --rotate 30,30,30 --size 8,8,8 "
            "--pitch 0.042mm,0.084mm,0.022mm");
  Example again;
  again.options.parse(splitWords(canonical));
  EXPECT_EQ(again.options.canonical(), canonical);
}

TEST(Options, CanonicalTextReadsBackWhereValuesLookLikeOptions) {
  Example example;
  example.options.parse(Words{"--prefix=--count", "--mask=-c", "--", "-5"});
  const std::string canonical = example.options.canonical();
  EXPECT_NE(canonical.find("--mask=-c --prefix=--count"), std::string::npos) << canonical;
  EXPECT_TRUE(canonical.ends_with(" -- -5")) << canonical;
  Example again;
  again.options.parse(splitWords(canonical));
  EXPECT_EQ(again.file, "-5");
  EXPECT_EQ(again.prefix, "--count");
  EXPECT_EQ(again.mask_file, "-c");
}

TEST(Options, CanonicalTextIsOneLine) {
  Example example;
  example.options.parse(Words{"a\n\x1b[1m'\\b"});
  const std::string canonical = example.options.canonical();
  EXPECT_TRUE(canonical.starts_with("$'a\\n\\x1b[1m\\'\\\\b' ")) << canonical;
  EXPECT_EQ(splitWords(canonical).front(), "a\n\x1b[1m'\\b");
}

TEST(Options, RefusalsSayWhatIsAccepted) {
  const Example example;
  const auto expectRefused = [&](const std::string& option, const std::string& value,
                                 const std::string& why) {
    EXPECT_EQ(refusal(example.options, {"a", "--" + option, value}),
              "--" + option + ": '" + value + "' is not accepted; " + why);
  };
  for (const std::string value : {"12", "0", "2.5", "x", "", "1e400", "nan"})
    expectRefused("count", value, "the value must be a whole number from 1 to 9");
  for (const std::string value : {"9", "-1", "nan", "inf", "4x", "1e999"})
    expectRefused("amplitude", value, "the value must be a number from 0 to 8");
  for (const std::string value : {"0", "-0", "-3", "auto2"})
    expectRefused("gain", value, "the value must be a number greater than 0, or auto");
  expectRefused("colour", "pink", "choose red, green or blue");
  for (const std::string value : {"2 parsec", "", "nan", "inf", "1e308m", "0dpi"})
    expectRefused("band", value, "give a length such as 0.042mm, 42um or 600dpi");
  for (const std::string value : {"0", "9um", "1e9mm", "-0.5"})
    expectRefused("band", value, "the length must be from 0.01 mm to 1 mm");
  for (const std::string value : {"0", "-0", "-3mm", "2m"})
    expectRefused("fit", value, "the length must be greater than 0 mm, up to 1000 mm");
  for (const std::string value : {"1,2", "1,2,3,4", "1,2,x", "0,0,361", "nan", ""})
    expectRefused("rotate", value,
                  "the value must be one number or three, separated by commas, each from -360 to "
                  "360");
  for (const std::string value : {"0", "1.5", "1,2,257", "1,2"})
    expectRefused("size", value,
                  "the value must be one whole number or three, separated by commas, each from 1 "
                  "to 256");
  for (const std::string value : {"0", "1,2,11", "1,2", "x"})
    expectRefused("pitch", value,
                  "the value must be one length or three, separated by commas, each from 0.001 mm "
                  "to 10 mm");
}

TEST(Options, AnEmptyNameOfAFileIsRefused) {
  std::string file;
  std::string page;
  std::string prefix = "slice_";
  Options options;
  options.positional("file", file, "The file", false);
  options.file("page", page, "FILE", "The page");
  options.text("prefix", prefix, "TEXT", "The prefix");
  EXPECT_EQ(refusal(options, {""}), "file: the name is empty");
  EXPECT_EQ(refusal(options, {"--page", ""}), "--page: the name is empty");
  EXPECT_EQ(refusal(options, {"--page="}), "--page: the name is empty");
  EXPECT_EQ(refusal(options, {"--prefix", ""}), "");
  EXPECT_EQ(prefix, "");
}

TEST(Options, AnOptionThatBelongsToAnotherIsRefusedWithoutIt) {
  bool smooth = false;
  int steps = 3;
  Options options;
  options.integer("steps", steps, {1, 9}, "How many");
  options.belongTo("--smooth", [&] { return smooth; });
  options.flag("smooth", smooth, "Smooths");
  EXPECT_EQ(options.canonical(), "");
  EXPECT_EQ(refusal(options, {"--steps", "4"}),
            "--steps: belongs to --smooth; leave it out, or give that too");
  EXPECT_EQ(refusal(options, {"--steps", "4", "--smooth"}), "");
  EXPECT_EQ(options.canonical(), "--steps 4 --smooth");
}

TEST(Options, AValueThatIsMissingIsToldHowToBeGiven) {
  const Example example;
  EXPECT_EQ(refusal(example.options, {"a", "--fit"}),
            "--fit: the value is missing; give --fit LENGTH");
  EXPECT_EQ(refusal(example.options, {"a", "-c"}), "--count: the value is missing; give --count N");
  EXPECT_EQ(refusal(example.options, {"a", "--colour", "--strict"}),
            "--colour: the value is missing; give --colour red|green|blue");
  EXPECT_EQ(refusal(example.options, {"a", "--gain", "-s"}),
            "--gain: the value is missing; give --gain auto|X");
  EXPECT_EQ(refusal(example.options, {"a", "--strict=no"}),
            "--strict: takes no value; leave '=' out");
}

TEST(Options, WhatIsNotExpectedAndWhatIsForgottenIsNamed) {
  const Example example;
  EXPECT_EQ(refusal(example.options, {"a", "b"}), "'b' is not expected; see --help");
  EXPECT_EQ(refusal(example.options, {}), "'file' is missing; see --help");
  EXPECT_EQ(refusal(example.options, {""}), "file: the name is empty");
  Options common;
  std::string input;
  common.file("input", input, "FILE.vdb", "The input");
  EXPECT_EQ(refusal(example.options, {"a", "b.vdb"}, common),
            "'b.vdb' is not expected; -i b.vdb reads it, -o b.vdb writes it");
  double thickness_mm = 0;
  Options needing;
  needing.length("thickness", thickness_mm, Range::above(0), "How thick");
  needing.required();
  EXPECT_EQ(refusal(needing, {}), "'--thickness' is missing; see --help");
  EXPECT_EQ(refusal(needing, {"--thickness", "1"}), "");
}

TEST(Options, AnUnknownOptionNamesTheNearest) {
  const Example example;
  EXPECT_EQ(refusal(example.options, {"a", "--amplitud", "2"}),
            "'--amplitud' is not an option; did you mean '--amplitude'?");
  EXPECT_EQ(refusal(example.options, {"a", "-amplitude=2"}),
            "'-amplitude=2' is not an option; did you mean '--amplitude'?");
  EXPECT_EQ(refusal(example.options, {"a", "--zzzzzzzz=1"}),
            "'--zzzzzzzz' is not an option; see --help");
  EXPECT_EQ(refusal(example.options, {"a", "-sx"}), "'-sx' is not an option; see --help");
}

TEST(Options, CommonOptionsYieldToTheOperatorsOwn) {
  Example example;
  Options common;
  int count_of_run = 0;
  int threads = 0;
  common.integer("count", count_of_run, {0, 100}, "Another count");
  common.integer("threads", threads, {0, 64}, "Threads");
  example.options.parse(Words{"a", "--count", "2", "--threads", "4"}, common);
  EXPECT_EQ(example.count, 2);
  EXPECT_EQ(count_of_run, 0);
  EXPECT_EQ(threads, 4);
}

TEST(Options, APresetFillsDefaultsWhereverItStands) {
  int count = 0;
  double width = 0;
  Colour colour = Colour::red;
  Options options;
  options.preset<Colour>(
      "preset", colour, colours,
      [&](Colour chosen) {
        count = static_cast<int>(chosen) + 1;
        width = 10 * count;
      },
      "The preset");
  options.integer("count", count, {0, 100}, "How many");
  options.number("width", width, {0, 100}, "How wide");
  EXPECT_EQ(options.canonical(), "--preset red --count 1 --width 10");
  EXPECT_EQ(options.find("count")->fallback, "1");
  options.parse(Words{"--count", "7", "--preset", "blue"});
  EXPECT_EQ(options.canonical(), "--preset blue --count 7 --width 30");
  options.parse(Words{"--preset=green", "--width", "5", "--preset=red"});
  EXPECT_EQ(options.canonical(), "--preset red --count 1 --width 5");
}

TEST(Options, AnOptionThatRepeatsTakesOneWordEachTime) {
  Options options;
  std::vector<std::string> holes;
  std::string file;
  options.texts("hole", holes, "X", "Holes");
  options.positional("file", file, "A file");
  options.parse(Words{"--hole", "a b", "part", "--hole=c"});
  EXPECT_EQ(holes, (Words{"a b", "c"}));
  EXPECT_EQ(file, "part");
  EXPECT_EQ(options.canonical(), "--hole 'a b' --hole c part");
}

TEST(Options, APositionalMayBeAChoice) {
  Options options;
  Colour colour = Colour::red;
  options.positional("colour", colour, colours, "The colour", false);
  options.parse(Words{});
  EXPECT_EQ(colour, Colour::red);
  options.parse(Words{"green"});
  EXPECT_EQ(colour, Colour::green);
  EXPECT_EQ(refusal(options, {"pink"}),
            "colour: 'pink' is not accepted; choose red, green or blue");
}

TEST(Options, ATableOfWordsThatIsKnownAtRunTimeIsAChoice) {
  Options options;
  std::string format = "png";
  options.choice("format", format, {{"png", "Portable"}, {"exr", "Open"}}, "The format");
  options.parse(Words{"--format", "exr"});
  EXPECT_EQ(format, "exr");
  EXPECT_EQ(refusal(options, {"--format", "gif"}),
            "--format: 'gif' is not accepted; choose png or exr");
}

TEST(Options, ChoicesKnowTheirNames) { EXPECT_EQ(nameOf(colours, Colour::green), "green"); }

}  // namespace
}  // namespace vdbdither
