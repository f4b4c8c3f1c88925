#include "io/stack/manifest.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/scratch_folder.h"
#include "vdbdither/engine/version.h"
#include "vdbdither/model/errors.h"

namespace vdbdither {
namespace {

using openvdb::Coord;
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
 ]
}
)";

/// `text` as the manifest of a stack.
Manifest readBack(const std::string& text) {
  const test::ScratchFolder folder;
  folder.write("manifest.json", text);
  return readManifest(StackInput(folder.path()));
}

TEST(Manifest, HasOneText) { EXPECT_EQ(textOf(example()), example_text); }

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
                                 "manifest.json': pitch_mm is not above zero; make the stack "
                                 "again with slice-export")));
  const auto misfit = ThrowsMessage<DataError>(
      HasSubstr("box, padding and layers do not fit together; make the stack again"));
  Manifest narrow = example();
  narrow.layout.padding = -1;
  EXPECT_THAT(reading(narrow), misfit);
  for (const ZRange layers : {ZRange{4, 4}, ZRange{3, 5}, ZRange{9, 11}}) {
    Manifest off = example();
    off.layers = layers;
    EXPECT_THAT(reading(off), misfit);
  }
}

TEST(Manifest, RefusesOtherFiles) {
  for (const char* text : {"", "{}", "[1]", "no JSON"}) {
    EXPECT_THAT([&] { readBack(text); },
                ThrowsMessage<DataError>(HasSubstr("is not a manifest of slice-export: ")));
  }
}

}  // namespace
}  // namespace vdbdither
