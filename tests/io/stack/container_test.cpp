#include "io/stack/container.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "io/image/png_spans.h"
#include "io/stack/stack_reader.h"
#include "tests/support/scratch_folder.h"
#include "tests/support/span_images.h"
#include "vdbdither/model/errors.h"

namespace vdbdither {
namespace {

using openvdb::Coord;
using openvdb::CoordBBox;
using testing::EndsWith;
using testing::HasSubstr;

constexpr const char* gcvf_text = R"(<?xml version="1.0" encoding="UTF-8"?>
<GCVF><Version>2</Version>
 <Resolution><XDpi>600</XDpi><YDpi>300</YDpi>
  <SliceThicknessNanoMeter>14000</SliceThicknessNanoMeter></Resolution>
 <SliceDimensions><SliceWidth>3</SliceWidth><SliceHeight>2</SliceHeight></SliceDimensions>
 <SliceRange><StartIndex>5</StartIndex><NumberOfSlices>2</NumberOfSlices></SliceRange>
 <ImageFilePrefix>layer_</ImageFilePrefix>
 <MaterialList><BackGroundMaterialRGBA>0 0 0 255</BackGroundMaterialRGBA>
  <Material><Name>VeroCY-V &amp; more</Name><RGBA>0 255 255 255</RGBA></Material></MaterialList>
</GCVF>)";
constexpr const char* job_text = "jobDir = a\nlayerHeight = 0.05\nnumFast = 1\nnumSlow = 1\n";
constexpr const char* slicer_text =
    "display_pixels_x = 3\ndisplay_pixels_y = 2\ndisplay_width = 0.06\ndisplay_height = 0.08\n"
    "display_mirror_x = 1\n";
constexpr const char* uvj_text =
    R"({"Properties": {"Size": {"X": 3, "Y": 2, "Millimeter": {"X": 0.06, "Y": 0.08},
        "Layers": 2, "LayerHeight": 0.05}}, "Layers": [{}, {}]})";

std::string replaced(std::string text, const std::string& from, const std::string& to) {
  const std::size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return text.replace(at, from.size(), to);
}

/// A container that is unpacked into a folder, with two slices of 3 x 2 pixels.
class Containers : public testing::Test {
 protected:
  void addSlices(const std::vector<std::string>& names, std::uint32_t colour) const {
    for (const std::string& name : names) {
      const std::vector<std::uint8_t> bytes =
          encodePng(test::spanImage(3, 2, [&](int x, int) { return x == 0 ? colour : black; }), {});
      std::filesystem::create_directories((scratch_ / name).parent_path());
      scratch_.write(name, {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
    }
  }

  /// Returns the end of the refusal, behind the name of the folder.
  [[nodiscard]] std::string refusal() const {
    try {
      const StackReader reader(scratch_.path(), EditedStack::refused, [](const std::string&) {});
      for (int z = 0; z < 2; ++z) static_cast<void>(reader.layer(z));
    } catch (const DataError& error) {
      std::string text = error.what();
      const std::string folder = scratch_.path().string() + "/";
      while (text.find(folder) != std::string::npos) text.erase(text.find(folder), folder.size());
      return text;
    }
    return "";
  }

  static constexpr std::uint32_t black = rgba(0, 0, 0);
  test::ScratchFolder scratch_;
};

TEST_F(Containers, AGcvfOfOthersIsReadAsItsConfigurationSays) {
  scratch_.write("ConfigFile.xml", gcvf_text);
  addSlices({"layer_5.png", "layer_6.png"}, rgba(0, 255, 255));
  const StackReader reader(scratch_.path(), EditedStack::refused, [](const std::string&) {});
  EXPECT_NEAR(reader.manifest().lattice.pitch_mm.x(), 25.4 / 600, 1e-12);
  EXPECT_NEAR(reader.manifest().lattice.pitch_mm.z(), 0.014, 1e-12);
  EXPECT_EQ(reader.manifest().lattice.box, CoordBBox(Coord(0, 0, 0), Coord(2, 1, 1)));
  EXPECT_EQ(reader.manifest().materials.front().name, "VeroCY-V & more");
  EXPECT_TRUE(reader.layer(1) == test::spanImage(3, 2, [](int x, int) { return x == 0; }));
}

TEST_F(Containers, AGcvfThatContradictsItselfIsRefused) {
  addSlices({"layer_5.png", "layer_6.png"}, rgba(0, 255, 255));
  const auto with = [&](const std::string& from, const std::string& to) {
    scratch_.write("ConfigFile.xml", replaced(gcvf_text, from, to));
    return refusal();
  };
  EXPECT_EQ(with("<XDpi>600</XDpi>", ""), "'ConfigFile.xml' has no XDpi");
  EXPECT_EQ(with("600", "six"),
            "'ConfigFile.xml': XDpi must be a number from 1 to 65535, not 'six'");
  EXPECT_EQ(with("0 255 255 255", "0 256 255 255"),
            "'ConfigFile.xml': a colour must be four whole numbers from 0 to 255, not '0 256 255 "
            "255'");
  EXPECT_EQ(with("<NumberOfSlices>2", "<NumberOfSlices>4000"),
            "'ConfigFile.xml' says that there are 4000 layers, and there are 3 files");
  EXPECT_EQ(with("<NumberOfSlices>2", "<NumberOfSlices>3"),
            "the slice 'layer_7.png' of layer 2 is missing; make the stack again with "
            "slice-export");
  EXPECT_EQ(
      with("<ImageFilePrefix>layer_", "<ImageFilePrefix>../layer_"),
      "'ConfigFile.xml': the name of the slice '../layer_5.png' has a folder whose name is '..'");
  EXPECT_THAT(with("<SliceWidth>3", "<SliceWidth>4"),
              EndsWith("has 3 x 2 pixels, not 4 x 2 as the stack; make the stack again with "
                       "slice-export"));
  EXPECT_THAT(with("0 255 255 255", "0 255 254 255"),
              testing::HasSubstr("has the colour 0,255,255,255 in column 0 of row 0, which no "
                                 "material of the manifest has"));
  EXPECT_THAT(with("</GCVF>", ""), testing::HasSubstr("'ConfigFile.xml'"));
}

TEST_F(Containers, AnSl1OfOthersIsReadAsItsConfigurationsSay) {
  scratch_.write("config.ini", job_text);
  scratch_.write("prusaslicer.ini", slicer_text);
  addSlices({"a00000.png", "a00001.png", "thumbnail/thumbnail400x400.png"}, rgba(255, 255, 255));
  const StackReader reader(scratch_.path(), EditedStack::refused, [](const std::string&) {});
  EXPECT_TRUE(openvdb::math::isApproxEqual(reader.manifest().lattice.pitch_mm, {0.02, 0.04, 0.05}));
  EXPECT_TRUE(reader.manifest().layout.flip_x);
  EXPECT_FALSE(reader.manifest().layout.flip_y);
  EXPECT_TRUE(reader.layer(0) == test::spanImage(3, 2, [](int x, int) { return x == 0; }));
}

TEST_F(Containers, AnSl1ThatContradictsItselfIsRefused) {
  scratch_.write("config.ini", job_text);
  addSlices({"a00000.png", "a00001.png"}, rgba(255, 255, 255));
  const auto with = [&](const std::string& from, const std::string& to) {
    scratch_.write("prusaslicer.ini", replaced(slicer_text, from, to));
    return refusal();
  };
  EXPECT_EQ(with("display_width = 0.06\n", ""), "'prusaslicer.ini': 'display_width' is missing");
  EXPECT_EQ(with("0.08", "0"),
            "'config.ini' says that a voxel is 0 mm long; it must be from 0.000001 to 1000");
  EXPECT_EQ(with("pixels_x = 3", "pixels_x = 1e9"),
            "'prusaslicer.ini': 'display_pixels_x' must be a number from 1 to 16777216, not '1e9'");
  scratch_.write("config.ini", replaced(job_text, "numFast = 1", "numFast = 0"));
  scratch_.write("config.ini", replaced(replaced(job_text, "numFast = 1", "numFast = 0"),
                                        "numSlow = 1", "numSlow = 0"));
  EXPECT_EQ(with("0.08", "0.08"),
            "'config.ini' says that the slices have 3 x 2 pixels and 0 layers; each must be from 1 "
            "to 16777216");
}

TEST_F(Containers, AUvjOfOthersIsReadAsItsConfigurationSays) {
  scratch_.write("config.json", uvj_text);
  addSlices({"slice/00000000.png", "slice/00000001.png"}, rgba(255, 255, 255));
  EXPECT_EQ(refusal(), "");
  scratch_.write("config.json", replaced(uvj_text, "\"Y\": 2", "\"Y\": \"2\""));
  EXPECT_EQ(refusal(), "'config.json': '/Properties/Size/Y' must be a number");
  scratch_.write("config.json", replaced(uvj_text, "\"Y\": 2", "\"Y\": 1e400"));
  EXPECT_EQ(refusal(), "'config.json': line 1, column 39: the number 1e400 is too large");
  scratch_.write("config.json", replaced(uvj_text, "\"Y\": 2", "\"Y\": 0.5"));
  EXPECT_EQ(refusal(), "'config.json': '/Properties/Size/Y' must be from 1 to 16777216");
  scratch_.write("config.json", std::string(uvj_text).substr(0, 60));
  EXPECT_THAT(refusal(), HasSubstr("'config.json': line "));
  EXPECT_THAT(refusal(), HasSubstr(": this is not JSON: "));
  scratch_.write("config.json", R"({"colour": "red"})");
  EXPECT_THAT(refusal(), EndsWith("holds no manifest.json, so it is not a stack made by "
                                  "slice-export"));
}

constexpr const char* volume_text = R"(<?xml version="1.0" encoding="UTF-8"?>
<model unit="millimeter" xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02"
  xmlns:v="http://schemas.3mf.io/3dmanufacturing/volumetric/2022/01"><resources>
 <basematerials id="1"><base name="ink" displaycolor="#01020304"/>
  <base name="glue" displaycolor="#aabbcc"/></basematerials>
 <v:image3d id="2"><v:imagestack rowcount="2" columncount="3" sheetcount="2">
  <v:imagesheet path="/a0.png"/><v:imagesheet path="/a1.png"/></v:imagestack></v:image3d>
 <v:image3d id="4"><v:imagestack rowcount="2" columncount="3" sheetcount="2">
  <v:imagesheet path="/b0.png"/><v:imagesheet path="/b1.png"/></v:imagestack></v:image3d>
 <v:functionfromimage3d id="3" image3did="2"/><v:functionfromimage3d id="5" image3did="4"/>
 <v:volumedata id="6"><v:composite basematerialid="1">
  <v:materialmapping functionid="3" transform="2.5 0 0 0 5 0 0 0 10 0.25 -1 0" channel="red"/>
  <v:materialmapping functionid="5" transform="2.5 0 0 0 5 0 0 0 10 0.25 -1 0" channel="red"/>
 </v:composite></v:volumedata></resources></model>)";

TEST_F(Containers, AVolumeOf3mfIsReadAsItsModelSays) {
  std::filesystem::create_directories(scratch_ / "3D");
  scratch_.write("3D/3dmodel.model", volume_text);
  addSlices({"a0.png", "a1.png"}, rgba(200, 200, 200));
  addSlices({"b0.png", "b1.png"}, rgba(100, 100, 100));
  const StackReader reader(scratch_.path(), EditedStack::refused, [](const std::string&) {});
  const Manifest& stack = reader.manifest();
  EXPECT_TRUE(openvdb::math::isApproxEqual(stack.lattice.pitch_mm, {0.4 / 3, 0.1, 0.05}));
  // The corner is at -0.1, 0.2 and 0 mm.
  EXPECT_EQ(stack.lattice.box.min(), Coord(0, 3, 1));
  EXPECT_NEAR(stack.lattice.position(stack.lattice.box.min()).x(), -0.1 + 0.2 / 3, 1e-12);
  EXPECT_NEAR(stack.lattice.position(stack.lattice.box.min()).y(), 0.25, 1e-12);
  EXPECT_NEAR(stack.lattice.position(stack.lattice.box.min()).z(), 0.025, 1e-12);
  EXPECT_EQ(stack.materials[0].rgba, (std::array<std::uint8_t, 4>{1, 2, 3, 4}));
  EXPECT_EQ(stack.materials[1].rgba, (std::array<std::uint8_t, 4>{0xaa, 0xbb, 0xcc, 255}));
  EXPECT_TRUE(reader.layer(stack.layers.begin) ==
              test::spanImage(3, 2, [](int x, int) { return x == 0; }));
}

TEST_F(Containers, AVolumeOf3mfThatContradictsItselfIsRefused) {
  std::filesystem::create_directories(scratch_ / "3D");
  addSlices({"a0.png", "a1.png", "b0.png", "b1.png"}, rgba(255, 255, 255));
  const auto with = [&](const std::string& from, const std::string& to) {
    scratch_.write("3D/3dmodel.model", replaced(volume_text, from, to));
    return refusal();
  };
  const std::string ours =
      "; slice-import reads volumes as slice-export writes them, an image for each material";
  EXPECT_EQ(with("<base name=\"ink\" displaycolor=\"#01020304\"/>", ""),
            "'3D/3dmodel.model': its composite does not map each material to a function" + ours);
  EXPECT_EQ(with("functionid=\"5\"", "functionid=\"7\""),
            "'3D/3dmodel.model': a material is not mapped to an image" + ours);
  EXPECT_EQ(with("<v:imagesheet path=\"/b1.png\"/>", ""),
            "'3D/3dmodel.model': an image has 1 sheets and not 2" + ours);
  EXPECT_EQ(with("0.25 -1 0", "0.5 -1 0"),
            "'3D/3dmodel.model': the images of its materials are not alike" + ours);
  EXPECT_THAT(with("#01020304", "#0102030"),
              testing::HasSubstr("has the colour '#0102030', which is not #RRGGBB or #RRGGBBAA"));
  EXPECT_THAT(with("rowcount=\"2\"", "rowcount=\"-2\""),
              testing::HasSubstr("has a rowcount '-2', which is no count"));
  EXPECT_THAT(with("/a0.png", "a0.png"),
              testing::HasSubstr("names a sheet 'a0.png', which must begin with '/'"));
  EXPECT_THAT(with("/a0.png", "/../a0.png"),
              testing::HasSubstr("the name of the slice '../a0.png'"));
  EXPECT_THAT(with(" image3did=\"2\"", ""),
              testing::HasSubstr("has a functionfromimage3d without image3did"));
  std::string turned = volume_text;
  for (int i = 0; i < 2; ++i) turned = replaced(turned, "2.5 0 0 0", "2.5 1 0 0");
  scratch_.write("3D/3dmodel.model", turned);
  EXPECT_THAT(refusal(), testing::HasSubstr("that does more than scale and shift"));
  // Voxels of two materials.
  scratch_.write("3D/3dmodel.model", volume_text);
  EXPECT_THAT(refusal(), testing::HasSubstr("has voxels in row 0 that another material has"));
}

TEST(ContainerPitch, MustBeThatOfThePrinter) {
  PrinterProfile printer;
  printer.pitch_mm = {0.02, 0.04, 0.05};
  Manifest stack;
  stack.lattice.pitch_mm = {0.02, 0.02, 0.05};
  EXPECT_NO_THROW(checkPitch("sl1", stack, printer));
  printer.name = "known";
  EXPECT_THAT([&] { checkPitch("sl1", stack, printer); },
              testing::ThrowsMessage<UsageError>(
                  "--format: sl1 is for the printer, and along y its voxels are 0.04 mm long, "
                  "those of the grid 0.02; bring the part to the lattice of the printer with "
                  "resample or interlace"));
  stack.lattice.pitch_mm.y() = 0.04;
  EXPECT_NO_THROW(checkPitch("sl1", stack, printer));
}

TEST(Thumbnail, KeepsTheShapeInTheMiddleOfBlack) {
  const std::uint32_t red = rgba(255, 0, 0);
  const Picture picture = thumbnailOf(
      test::spanImage(40, 20, [&](int x, int) { return x < 20 ? red : rgba(255, 255, 255); }), 8,
      8);
  ASSERT_EQ(picture.width, 8U);
  for (std::uint32_t y = 0; y < 8; ++y) {
    const bool inside = y >= 2 && y < 6;
    EXPECT_EQ(picture.pixels[8 * y], inside ? red : rgba(0, 0, 0)) << y;
    EXPECT_EQ(picture.pixels[8 * y + 7], inside ? rgba(255, 255, 255) : rgba(0, 0, 0)) << y;
  }
  // Half of the light is not half of the code.
  const Picture fine = thumbnailOf(
      test::spanImage(16, 16,
                      [](int x, int) { return x % 2 ? rgba(255, 255, 255) : rgba(0, 0, 0); }),
      8, 8);
  EXPECT_EQ(fine.pixels[0], rgba(188, 188, 188));
  EXPECT_EQ(
      thumbnailOf(test::spanImage(2, 2, [&](int, int) { return red; }), 8, 8).pixels[3 * 8 + 3],
      red);
}

}  // namespace
}  // namespace vdbdither
