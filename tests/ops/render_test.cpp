#include <fstream>
#include <map>
#include <memory>

#include <ImathBox.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfInputFile.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "io/image/picture.h"
#include "tests/support/drawn_grids.h"
#include "tests/support/filters.h"
#include "tests/support/mesh_files.h"
#include "tests/support/png_reader.h"
#include "tests/support/scratch_folder.h"
#include "tests/support/shapes.h"
#include "tests/support/sinks.h"
#include "vdbdither/model/errors.h"

namespace vdbdither {
namespace {

using openvdb::BoolGrid;
using openvdb::Coord;
using openvdb::CoordBBox;
using openvdb::Vec3d;
using testing::HasSubstr;
using testing::ThrowsMessage;

struct Rendering : test::SinkCalled {
  explicit Rendering(const std::vector<std::string>& arguments) : SinkCalled("render", arguments) {}
};

struct RenderingMesh : test::FileToolCalled {
  explicit RenderingMesh(const std::vector<std::string>& arguments)
      : FileToolCalled("render", arguments) {}
};

/// A scratch folder with a part: a box of 2 × 1 × 1 mm.
class Render : public testing::Test {
 protected:
  void SetUp() override {
    scratch.write("part.stl", test::binaryStl(test::boxMesh({0, 0, 0}, {2, 1, 1})));
  }
  [[nodiscard]] std::string file(const std::string& name) const { return scratch / name; }

  test::ScratchFolder scratch;
};

const std::vector<std::string> from_above{"--elevation",  "90",           "--azimuth", "0",
                                          "--projection", "orthographic", "--pixel",   "0.1"};

std::vector<std::string> with(std::vector<std::string> words,
                              const std::vector<std::string>& more) {
  words.insert(words.end(), more.begin(), more.end());
  return words;
}

/// Checks that an opaque pixel has this grey, to one.
void expectGrey(std::uint32_t pixel, int grey) {
  EXPECT_EQ(pixel >> 24, 255U);
  for (const int channel : {0, 8, 16})
    EXPECT_NEAR(static_cast<int>(pixel >> channel & 255), grey, 1) << channel;
}

TEST_F(Render, AMeshOfItsOwnIsDrawnWithoutAChain) {
  const RenderingMesh rendering(with({file("part.stl"), file("part.png")}, from_above));
  rendering.run();
  const Picture picture = readPicture(scratch / "part.png");
  EXPECT_EQ(picture.width, 20U + 16U);
  EXPECT_EQ(picture.height, 10U + 16U);
  EXPECT_EQ(picture.pixels.front(), 0U) << "around it nothing";
  const std::uint32_t middle = picture.pixels[13 * 36 + 18];
  EXPECT_EQ(middle >> 24, 255U);
  // Linear 0.6 is 203 in sRGB.
  EXPECT_NEAR(middle & 255, 203, 1);
  EXPECT_EQ(middle & 255, middle >> 8 & 255);
}

TEST_F(Render, BrightnessIsWhatAHorizontalPlaceBecomes) {
  RenderingMesh(with({file("part.stl"), file("part.png"), "--brightness", "0.2140411"}, from_above))
      .run();
  EXPECT_NEAR(readPicture(scratch / "part.png").pixels[13 * 36 + 18] & 255, 127.5, 1);
}

TEST_F(Render, VoxelsAreDrawnAsTheyComeInSlabsOfAnyHeight) {
  const Lattice lattice{{0.1, 0.1, 0.05}, {0, 0, 0}, CoordBBox(Coord(-4), Coord(30))};
  const auto solid = BoolGrid::create(false);
  solid->setName("solid");
  solid->tree().sparseFill(CoordBBox(Coord(0, 0, 0), Coord(19, 9, 19)), true);
  const Schema schema = test::schemaOf(lattice, {{"solid", solid}});
  std::vector<std::vector<std::uint8_t>> pictures;
  for (const int height : {8, 16, 1000}) {
    Rendering({file("print.png"), "--frame", file("part.stl"), "--overwrite"}).run(schema, height);
    pictures.push_back(test::fileBytes(scratch / "print.png"));
  }
  EXPECT_EQ(pictures[1], pictures[0]);
  EXPECT_EQ(pictures[2], pictures[0]);
  Rendering(with({file("print.png"), "--frame", file("part.stl"), "--overwrite"}, from_above))
      .run(schema);
  const Picture picture = readPicture(scratch / "print.png");
  ASSERT_EQ(std::pair(picture.width, picture.height), std::pair(36U, 26U));
  // Pixel (8, 17) shows the part's origin; voxel centres lie at multiples of a pixel.
  const auto pixel = [&](std::size_t x, std::size_t y) { return picture.pixels[36 * y + x]; };
  expectGrey(pixel(18, 13), 203);
  expectGrey(pixel(8, 17), 203);
  EXPECT_EQ(pixel(6, 13), 0U);
  EXPECT_EQ(pixel(18, 20), 0U);
  EXPECT_EQ(pixel(29, 13), 0U);
}

TEST_F(Render, BlocksHaveNoSlopes) {
  const Lattice lattice{{0.1, 0.1, 0.1}, {0, 0, 0}, CoordBBox(Coord(-4), Coord(30))};
  const auto solid = BoolGrid::create(false);
  solid->setName("solid");
  for (int step = 0; step < 20; ++step)
    solid->tree().sparseFill(CoordBBox(Coord(step, 0, 0), Coord(19, 9, step)), true);
  const Schema schema = test::schemaOf(lattice, {{"solid", solid}});
  const auto middle = [&](const std::vector<std::string>& more) {
    Rendering(with(with({file("print.png"), "--look", "sky", "--overwrite"}, from_above), more))
        .run(schema);
    const Picture picture = readPicture(scratch / "print.png");
    return picture.pixels[picture.pixels.size() / 2 + picture.width / 2] & 255;
  };
  // A slope of 45 degrees sees most of the sky; of a tread as wide as its riser is high a part is
  // hidden behind the next.
  EXPECT_GT(middle({}), middle({"--blocks"}) + 5U);
}

TEST_F(Render, AFrameMakesPicturesComparable) {
  scratch.write("small.stl", test::binaryStl(test::boxMesh({0.5, 0.25, 0}, {1, 0.75, 0.5})));
  RenderingMesh({file("part.stl"), file("part.png")}).run();
  RenderingMesh({file("small.stl"), file("framed.png"), "--frame", file("part.stl")}).run();
  RenderingMesh({file("small.stl"), file("own.png")}).run();
  RenderingMesh(
      with({file("small.stl"), file("above.png"), "--frame", file("part.stl")}, from_above))
      .run();
  const Picture part = readPicture(scratch / "part.png");
  const Picture framed = readPicture(scratch / "framed.png");
  EXPECT_EQ(std::pair(framed.width, framed.height), std::pair(part.width, part.height));
  EXPECT_LT(readPicture(scratch / "own.png").width, part.width);
  const Picture above = readPicture(scratch / "above.png");
  ASSERT_EQ(std::pair(above.width, above.height), std::pair(36U, 26U));
  // Of 0.1 mm, from 8 pixels beside the part of 2 x 1 mm on; the small box lies within 0.5 to 1 and
  // 0.25 to 0.75 mm.
  expectGrey(above.pixels[36 * 13 + 8 + 7], 203);
  EXPECT_EQ(above.pixels[36 * 13 + 8 + 3], 0U);
  EXPECT_EQ(above.pixels[36 * 13 + 8 + 12], 0U);
}

TEST_F(Render, AnExrHoldsTheLightTimesTheCover) {
  // 1.95 mm are 19.5 of 20 pixels: a quarter of a pixel is free on either side.
  scratch.write("narrow.stl", test::binaryStl(test::boxMesh({0, 0, 0}, {1.95, 1, 1})));
  RenderingMesh(with({file("narrow.stl"), file("part.exr")}, from_above)).run();
  Imf::InputFile exr((scratch / "part.exr").c_str());
  const Imath::Box2i window = exr.header().dataWindow();
  ASSERT_EQ(std::pair(window.max.x, window.max.y), std::pair(35, 25));
  std::map<std::string, std::vector<float>> channels;
  Imf::FrameBuffer buffer;
  for (const char* name : {"A", "R", "G", "B"}) {
    channels[name].assign(36 * 26, -1);
    buffer.insert(
        name, Imf::Slice(Imf::FLOAT, reinterpret_cast<char*>(channels[name].data()), 4, 4 * 36));
  }
  exr.setFrameBuffer(buffer);
  exr.readPixels(0, 25);
  const auto expectPixel = [&](std::size_t x, double cover, double tolerance) {
    const std::size_t at = 36 * 13 + x;
    EXPECT_NEAR(channels["A"][at], cover, tolerance) << x;
    for (const char* name : {"R", "G", "B"})
      EXPECT_NEAR(channels[name][at], 0.6 * channels["A"][at], 2e-3) << name << " " << x;
  };
  expectPixel(18, 1, 0);
  expectPixel(8, 0.75, 0.1);
  expectPixel(27, 0.75, 0.1);
  expectPixel(6, 0, 0);
}

TEST_F(Render, RefusesWhatCannotBeDrawn) {
  const auto plan = [&](const std::vector<std::string>& arguments) {
    return [=] { RenderingMesh(arguments).run(); };
  };
  EXPECT_THAT(plan({"a.stl", "b.jpg"}),
              ThrowsMessage<UsageError>("'b.jpg' must end in .png or .exr"));
  EXPECT_THAT(plan({"a.stl", file("b.png"), "--blocks"}),
              ThrowsMessage<UsageError>("--blocks: a mesh has no voxels"));
  EXPECT_THAT(plan({"a.stl", "b.png", "--pixel", "0"}),
              ThrowsMessage<UsageError>("--pixel: '0' is not accepted; the length must be "
                                        "greater than 0 mm, up to 1000 mm"));
  EXPECT_THAT(plan({"a.stl", "b.png", "--distance", "0"}),
              ThrowsMessage<UsageError>("--distance: '0' is not accepted; the length must be "
                                        "greater than 0 mm, up to 1000000 mm"));
  EXPECT_THAT(plan({"a.stl", file("b.png"), "--frame", file("none.stl")}),
              ThrowsMessage<DataError>(HasSubstr("no such file")));
  EXPECT_THAT([&] { Rendering({file("b.png")})->plan({}); },
              ThrowsMessage<DataError>(HasSubstr("there is none")));
  std::ofstream(scratch / "there.png") << "x";
  EXPECT_THAT(plan({file("part.stl"), file("there.png")}),
              ThrowsMessage<UsageError>(HasSubstr("exists; --overwrite replaces it")));
  const auto nothing = BoolGrid::create(false);
  nothing->setName("solid");
  const Lattice lattice{{0.1, 0.1, 0.05}, {0, 0, 0}, CoordBBox(Coord(0), Coord(15))};
  EXPECT_THAT(
      [&] {
        Rendering({file("n.png")}).run(test::schemaOf(lattice, {{"solid", nothing}}));
      },
      ThrowsMessage<DataError>("grid 'solid' has no surface: nothing of it is inside"));
}

}  // namespace
}  // namespace vdbdither
