#include "io/stack/manifest.h"

#include <filesystem>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "io/file/digest.h"
#include "tests/support/scratch_folder.h"
#include "vdbdither/engine/version.h"
#include "vdbdither/model/errors.h"

namespace vdbdither {
namespace {

using openvdb::Coord;
using testing::AllOf;
using testing::EndsWith;
using testing::HasSubstr;
using testing::ThrowsMessage;

Manifest example() {
  Manifest manifest;
  manifest.format = "png1";
  manifest.printer = R"({"name":"mine","pitch_mm":[0.5,1.0,0.25]})";
  manifest.history = {"mesh2sdf part.stl", "dither"};
  manifest.lattice = {{0.5, 1, 0.25}, {0, 0.125, 0}, {Coord(-1, 0, 4), Coord(2, 1, 9)}};
  manifest.layout = {manifest.lattice.box, 1, false, true};
  manifest.background = {1, 2, 3, 0};
  manifest.materials = {{"white", {240, 240, 240, 255}}, {"black", {26, 26, 29, 255}}};
  manifest.voxels = {8, 0};
  manifest.layers = {4, 5};
  manifest.slices = {{4, "white/slice_00000.png", "00ff", "white"},
                     {4, "black/slice_00000.png", "ff00", "black"}};
  return manifest;
}

/// The digest of the canonical form of the example.
const std::string digest = [] {
  const std::string canonical =
      R"({"background":[1,2,3,0],"box":{"max":[2,1,9],"min":[-1,0,4]},"creator":"vdbdither )" +
      std::string(version) +
      R"(","cropped":{"above":0,"below":0},"first_layer":4,"flip_x":false,"flip_y":true,)"
      R"("format":"png1","grid":"material","history":["mesh2sdf part.stl","dither"],)"
      R"("materials":[{"index":1,"ml":0.001,"name":"white","rgba":[240,240,240,255],"voxels":8},)"
      R"({"index":2,"ml":0,"name":"black","rgba":[26,26,29,255],"voxels":0}],)"
      R"("origin_mm":[0,0.125,0],"padding":1,"pitch_mm":[0.5,1,0.25],)"
      R"("printer":{"name":"mine","pitch_mm":[0.5,1,0.25]},"size":[6,4,1],"slices":[)"
      R"({"file":"white/slice_00000.png","layer":4,"material":"white","sha256":"00ff"},)"
      R"({"file":"black/slice_00000.png","layer":4,"material":"black","sha256":"ff00"}]})";
  return sha256Of({reinterpret_cast<const std::uint8_t*>(canonical.data()), canonical.size()});
}();

const std::string example_text = R"({
 "creator": "vdbdither )" + std::string(version) +
                                 R"(",
 "printer": {
  "name": "mine",
  "pitch_mm": [
   0.5,
   1.0,
   0.25
  ]
 },
 "format": "png1",
 "grid": "material",
 "pitch_mm": [
  0.5,
  1.0,
  0.25
 ],
 "origin_mm": [
  0.0,
  0.125,
  0.0
 ],
 "size": [
  6,
  4,
  1
 ],
 "first_layer": 4,
 "cropped": {
  "below": 0,
  "above": 0
 },
 "box": {
  "min": [
   -1,
   0,
   4
  ],
  "max": [
   2,
   1,
   9
  ]
 },
 "padding": 1,
 "flip_x": false,
 "flip_y": true,
 "background": [
  1,
  2,
  3,
  0
 ],
 "materials": [
  {
   "index": 1,
   "name": "white",
   "rgba": [
    240,
    240,
    240,
    255
   ],
   "voxels": 8,
   "ml": 0.001
  },
  {
   "index": 2,
   "name": "black",
   "rgba": [
    26,
    26,
    29,
    255
   ],
   "voxels": 0,
   "ml": 0.0
  }
 ],
 "history": [
  "mesh2sdf part.stl",
  "dither"
 ],
 "slices": [
  {
   "layer": 4,
   "file": "white/slice_00000.png",
   "sha256": "00ff",
   "material": "white"
  },
  {
   "layer": 4,
   "file": "black/slice_00000.png",
   "sha256": "ff00",
   "material": "black"
  }
 ],
 "sha256": ")" + digest +
                                 R"("
}
)";

/// `text` as the manifest of a stack.
Manifest readBack(const std::string& text, EditedStack edited = EditedStack::refused,
                  std::vector<std::string>* warnings = nullptr) {
  const test::ScratchFolder folder;
  folder.write("manifest.json", text);
  return readManifest(StackInput(folder.path()), edited, [&](const std::string& warning) {
    ASSERT_NE(warnings, nullptr) << warning;
    warnings->push_back(warning);
  });
}

std::string replaced(std::string text, const std::string& old, const std::string& by) {
  const std::size_t at = text.find(old);
  EXPECT_NE(at, text.npos) << old;
  return text.replace(at, old.size(), by);
}

/// What reading `text` is refused for, or an empty text.
std::string refusal(const std::string& text, EditedStack edited = EditedStack::refused) {
  std::vector<std::string> warnings;
  try {
    readBack(text, edited, &warnings);
  } catch (const DataError& error) {
    const std::string said = error.what();
    return said.substr(said.find("manifest.json'"));
  }
  return "";
}

TEST(Manifest, StatesTheFrameWhereSlicesShowAnotherBox) {
  Manifest manifest = example();
  manifest.layout.box = {Coord(-3, 0, 4), Coord(9, 0, 9)};
  manifest.layout.padding = 0;
  const std::string text = textOf(manifest);
  EXPECT_THAT(text, HasSubstr("\"frame\""));
  const test::ScratchFolder scratch;
  scratch.write("manifest.json", text);
  const Manifest read =
      readManifest(StackInput(scratch.path()), EditedStack::refused, [](const std::string&) {});
  EXPECT_EQ(read.layout.box, manifest.layout.box);
  EXPECT_EQ(read.lattice.box, example().lattice.box);
  EXPECT_EQ(textOf(example()).find("frame"), std::string::npos);
}

TEST(Manifest, HasOneText) { EXPECT_EQ(textOf(example()), example_text); }

TEST(Manifest, MayBeWrittenAnewByAnotherProgram) {
  const nlohmann::json sorted = nlohmann::json::parse(example_text);
  EXPECT_EQ(refusal(sorted.dump()), "");
  EXPECT_EQ(refusal(sorted.dump(8)), "");
  EXPECT_EQ(refusal(replaced(example_text, "   0.5,\n   1.0,", "5e-1, 1,")), "");
}

TEST(Manifest, IsRefusedWhereItChanged) {
  const std::string changed =
      "manifest.json' was changed after slice-export wrote it: its digest differs; make the stack "
      "again with slice-export, or give --edited to take it as it is";
  EXPECT_EQ(refusal(replaced(example_text, "\"padding\": 1", "\"padding\": 2")), changed);
  EXPECT_EQ(refusal(replaced(example_text, "\"flip_x\": false", "\"flip_x\": true")), changed);
  EXPECT_EQ(refusal(replaced(example_text, "\"flip_y\"", "\"flip_Y\"")), changed);
  EXPECT_EQ(refusal(replaced(example_text, "\"creator\"", "\"more\": 1, \"creator\"")), changed);
  EXPECT_EQ(refusal(replaced(example_text, "00ff", "00fe")), changed);
  EXPECT_EQ(refusal(replaced(example_text, "dither\"", "dither \"")), changed);
  EXPECT_EQ(refusal(replaced(example_text, digest, "00" + digest.substr(2))), changed);
  EXPECT_EQ(refusal(replaced(example_text, "\"sha256\": \"" + digest, "\"digest\": \"" + digest)),
            "manifest.json' has no digest of itself, so it was edited or made by an earlier "
            "version; make the stack again with slice-export, or give --edited to take it as it "
            "is");
}

TEST(Manifest, IsTakenAsItIsOnDemandWithAWarning) {
  std::vector<std::string> warnings;
  const Manifest read = readBack(replaced(example_text, "\"flip_x\": false", "\"flip_x\": true"),
                                 EditedStack::taken, &warnings);
  EXPECT_TRUE(read.layout.flip_x);
  EXPECT_THAT(warnings,
              testing::ElementsAre(HasSubstr("manifest.json' was changed after slice-export wrote "
                                             "it: its digest differs; it is taken as it is")));
}

TEST(Manifest, RefusesValuesThatAreNone) {
  const auto with = [](const std::string& old, const std::string& by) {
    const std::string said = refusal(replaced(example_text, old, by), EditedStack::taken);
    const std::string begin = "manifest.json' is not a manifest of slice-export: ";
    const std::string end = "; make the stack again with slice-export";
    EXPECT_TRUE(said.starts_with(begin) && said.ends_with(end)) << said;
    return said.size() < begin.size() + end.size()
               ? said
               : said.substr(begin.size(), said.size() - begin.size() - end.size());
  };
  EXPECT_EQ(with("\"flip_y\"", "\"flip_Y\""), "'flip_y' is missing");
  EXPECT_EQ(with("\"flip_y\": true", "\"flip_y\": 1"), "'flip_y' is neither true nor false");
  EXPECT_EQ(with("\"padding\": 1", "\"padding\": 1.5"),
            "'padding' must be a whole number from 0 to 16777216");
  EXPECT_EQ(with("\"padding\": 1", "\"padding\": 4294967297"),
            "'padding' must be a whole number from 0 to 16777216");
  EXPECT_EQ(with("\"padding\": 1", "\"padding\": -1"),
            "'padding' must be a whole number from 0 to 16777216");
  EXPECT_EQ(with("\"padding\": 1", "\"padding\": 1e400"),
            "line 45, column 13: the number 1e400 is too large");
  EXPECT_EQ(with("\"first_layer\": 4", "\"first_layer\": 4e18"),
            "'first_layer' must be a whole number from -536870912 to 536870912");
  EXPECT_EQ(with("  6,\n  4,\n", "  6,\n  5,\n"),
            "'size' must be the width and height that follow from 'box' or 'frame' and 'padding', "
            "and the number of layers");
  EXPECT_EQ(with("  26,\n    26", "  26,\n    282") == "", false);
  EXPECT_EQ(with(" 29,", " 285,"), "'rgba' must be a whole number from 0 to 255");
  EXPECT_EQ(with("  2,\n  3,\n  0\n", "  2,\n  3\n"), "'background' must be four whole numbers");
  EXPECT_EQ(with("  0.125,", "  1e300,"),
            "'origin_mm' must be three lengths of at most 1000000 mm");
  EXPECT_EQ(with("   -1,\n   0,\n   4\n", "   -1, 4\n"), "'min' must be three whole numbers");
  EXPECT_EQ(with("\"mesh2sdf part.stl\"", "7"), "'history' is not a list of texts");
  EXPECT_EQ(with("\"format\": \"png1\"", "\"format\": null"), "'format' is not a text");
  EXPECT_EQ(with("\"slices\"", "\"slice\""), "'slices' is missing");
}

TEST(Manifest, RefusesSlicesOutsideTheStack) {
  const auto named = [](const std::string& name) {
    return refusal(replaced(example_text, "white/slice_00000.png", name), EditedStack::taken);
  };
  const std::string again = "; make the stack again with slice-export";
  EXPECT_EQ(named("../slice_00000.png"),
            "manifest.json': the name of the slice '../slice_00000.png' has a folder whose name is "
            "'..'" +
                again);
  EXPECT_EQ(
      named("/tmp/slice_00000.png"),
      "manifest.json': the name of the slice '/tmp/slice_00000.png' is an absolute path" + again);
  EXPECT_EQ(named(""), "manifest.json': the name of the slice '' is empty" + again);
}

TEST(Manifest, RefusesWhatWouldTakeTooMuch) {
  const auto reason = [](const std::string& text) {
    const std::string said = refusal(text);
    EXPECT_TRUE(said.starts_with("manifest.json' is not a manifest of slice-export: ")) << said;
    return said.substr(said.find(": ") + 2, said.find(';') - said.find(": ") - 2);
  };
  EXPECT_EQ(reason(std::string(100000, '[')), "it is nested too deeply");
  std::string keys = "{";
  for (int i = 0; i < 200; ++i) keys += "\"" + std::to_string(i) + "\":0,";
  EXPECT_EQ(reason(keys), "an object has too many keys");
  std::string values = "{\"slices\":[0";
  for (int i = 0; i < 1 << 22; ++i) values += ",0";
  EXPECT_EQ(reason(values + "]}"), "it holds too many values");
}

TEST(Manifest, OfMoreThan64MebibytesIsNotRead) {
  const test::ScratchFolder folder;
  folder.write("manifest.json", "{}");
  std::filesystem::resize_file(folder / "manifest.json", (64 << 20) + 1);
  EXPECT_THAT([&] { readManifest(StackInput(folder.path()), EditedStack::taken, {}); },
              ThrowsMessage<DataError>(HasSubstr("has 67108865 bytes; at most 67108864 are read")));
}

TEST(Manifest, TellsWhichFilesAreOfTheStack) {
  const test::ScratchFolder folder;
  folder.write("manifest.json", R"({"slices": [{"file": "b/1"}, {"file": "a"}], "more": 0})");
  EXPECT_THAT(filesNamedBy(StackInput(folder.path())), testing::ElementsAre("a", "b/1"));
  folder.write("manifest.json", R"({"slices": [{"file": "../b"}]})");
  EXPECT_THROW(filesNamedBy(StackInput(folder.path())), DataError);
}

TEST(Manifest, OfAHistoryThatIsNotUtf8ReadsBack) {
  Manifest odd = example();
  odd.history = {"mesh2sdf caf\xe9.stl"};
  EXPECT_THAT(readBack(textOf(odd)).history, testing::ElementsAre("mesh2sdf caf\\xe9.stl"));
}

TEST(Manifest, ReadsBackWhatItSays) {
  Manifest read = readBack(example_text);
  EXPECT_EQ(read.format, "png1");
  EXPECT_EQ(read.printer, example().printer);
  EXPECT_EQ(read.lattice, example().lattice);
  EXPECT_EQ(read.layers, example().layers);
  read.voxels = example().voxels;
  EXPECT_EQ(textOf(read), example_text);
}

TEST(Manifest, OfAnUnknownPrinterAndNoHistoryReadsBackTheSame) {
  Manifest plain = example();
  plain.printer.clear();
  plain.history.clear();
  plain.grid = "solid";
  plain.slices = {{4, "slice_00000.png", "00ff", ""}};
  EXPECT_THAT(textOf(plain), HasSubstr("\"printer\": null,"));
  EXPECT_THAT(textOf(plain), HasSubstr("\"history\": [],"));
  EXPECT_THAT(textOf(plain), testing::Not(HasSubstr("\"material\"")));
  Manifest read = readBack(textOf(plain));
  read.voxels = plain.voxels;
  EXPECT_EQ(textOf(read), textOf(plain));
}

TEST(Manifest, RefusesWhatDoesNotFitTogether) {
  const auto reading = [](const Manifest& manifest) {
    return [text = textOf(manifest)] { readBack(text); };
  };
  Manifest flat = example();
  flat.lattice.pitch_mm.z() = 0;
  EXPECT_THAT(reading(flat), ThrowsMessage<DataError>(HasSubstr(
                                 "manifest.json': pitch_mm is below 0.000001; make the stack "
                                 "again with slice-export")));
  const auto misfit = ThrowsMessage<DataError>(
      HasSubstr("box, padding and layers do not fit together; make the stack again"));
  Manifest narrow = example();
  narrow.layout.padding = 1 << 23;
  EXPECT_THAT(reading(narrow), misfit);
  for (const ZRange layers : {ZRange{4, 4}, ZRange{3, 5}, ZRange{9, 11}}) {
    Manifest off = example();
    off.layers = layers;
    EXPECT_THAT(reading(off), misfit);
  }
}

TEST(Manifest, OfSlicesThatAreTooWideTooHighOrTooManyIsRefused) {
  constexpr int widest = 1 << 24;
  for (int axis = 0; axis < 3; ++axis) {
    Manifest large = example();
    const auto withVoxels = [&](int count) {
      large.layout.box.max()[axis] = large.layout.box.min()[axis] + count - 1;
      if (axis == 2) large.lattice.box = large.layout.box;
      return textOf(large);
    };
    const int padding = axis < 2 ? large.layout.padding : 0;
    EXPECT_EQ(refusal(withVoxels(widest - 2 * padding)), "") << axis;
    EXPECT_THAT(refusal(withVoxels(widest - 2 * padding + 1)),
                HasSubstr("box, padding and layers do not fit together"))
        << axis;
  }
}

TEST(Manifest, RefusesASizeThatDoesNotFollowFromBoxAndPadding) {
  const auto refused = HasSubstr("'size' must be the width and height that follow from");
  for (const char* size : {"  5,\n  4,\n", "  6,\n  3,\n"})
    EXPECT_THAT(refusal(replaced(example_text, "  6,\n  4,\n", size), EditedStack::taken), refused);
  EXPECT_THAT(
      refusal(replaced(example_text, "\"padding\": 1", "\"padding\": 0"), EditedStack::taken),
      refused);
}

// A check of a stack looks at every layer.
TEST(Manifest, RefusesManyMoreLayersThanItNames) {
  nlohmann::json json = nlohmann::json::parse(example_text);
  json["size"][2] = 65546;
  json["box"]["max"][2] = 1 << 20;
  const std::size_t slices = json["slices"].size();
  EXPECT_THAT(refusal(json.dump(), EditedStack::taken),
              HasSubstr("it has 65546 layers and names " + std::to_string(slices) + " slices"));
}

TEST(Manifest, RefusesOtherFiles) {
  for (const char* text : {"", "{}", "[1]", "no JSON"}) {
    EXPECT_THAT([&] { readBack(text); },
                ThrowsMessage<DataError>(HasSubstr("is not a manifest of slice-export: ")));
  }
  EXPECT_THAT(refusal("{\"a\": nothing}"),
              AllOf(HasSubstr("manifest.json' is not a manifest of slice-export: line 1, column 8: "
                              "this is not JSON: "),
                    EndsWith("; make the stack again with slice-export")));
  EXPECT_THAT(refusal(std::string("{}\n\0]", 5)),
              HasSubstr("line 2, column 1: this is not JSON: a zero byte"));
}

}  // namespace
}  // namespace vdbdither
