#include "io/stack/slice_frame.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "vdbdither/model/errors.h"

namespace vdbdither {
namespace {

using openvdb::Coord;
using openvdb::CoordBBox;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::ThrowsMessage;

/// A display of 100 x 60 pixels of 20 x 40 µm.
PrinterProfile display() {
  PrinterProfile printer;
  printer.name = "display";
  printer.title = "A display";
  printer.pitch_mm = {0.02, 0.04, 0.05};
  printer.slice_px = {100, 60};
  printer.mirror_x = true;
  return printer;
}

struct Planned {
  SliceLayout layout;
  std::vector<std::string> warnings;
};

Planned planned(const CoordBBox& part, const FrameOptions& options, const char* format,
                const PrinterProfile& printer) {
  Manifest stack;
  stack.lattice = {{0.02, 0.04, 0.05}, {0, 0, 0}, part};
  Planned result;
  planFrame(
      options, part, *findSliceFormat(format), printer,
      [&](const std::string& text) { result.warnings.push_back(text); }, stack);
  result.layout = stack.layout;
  return result;
}

const CoordBBox part(Coord(10, 10, -3), Coord(29, 19, 8));

TEST(SliceFrame, ShowsThePartAloneOrWithSpaceAroundIt) {
  EXPECT_EQ(planned(part, {}, "png", display()).layout.box, part);
  const Planned wide = planned(part, {.margin_mm = 0.09, .padding = 2}, "png", display());
  EXPECT_EQ(wide.layout.box, CoordBBox(Coord(5, 7, -3), Coord(34, 22, 8)));
  EXPECT_EQ(wide.layout.width(), 34U);
  EXPECT_EQ(wide.layout.height(), 20U);
  EXPECT_FALSE(wide.layout.flip_x);
}

TEST(SliceFrame, ATrayHasThePartWhereItsCoordinatesSayOrInTheMiddle) {
  EXPECT_EQ(planned(part, {.tray = Tray::placed}, "png", display()).layout.box,
            CoordBBox(Coord(0, 0, -3), Coord(99, 59, 8)));
  PrinterProfile centred = display();
  centred.origin = "centre";
  EXPECT_EQ(planned(part, {.tray = Tray::placed}, "png", centred).layout.box,
            CoordBBox(Coord(-50, -30, -3), Coord(49, 29, 8)));
  const CoordBBox middle = planned(part, {.tray = Tray::centred}, "png", display()).layout.box;
  EXPECT_EQ(middle, CoordBBox(Coord(-30, -15, -3), Coord(69, 44, 8)));
  // The size of the tray follows from the volume where no pixels are stated.
  PrinterProfile jetting = display();
  jetting.slice_px = {0, 0};
  jetting.build_mm = {2, 2.4, 1};
  EXPECT_EQ(planned(part, {.tray = Tray::centred}, "png", jetting).layout.box, middle);
}

TEST(SliceFrame, DisplaysAreShownWholeAndMirroredByTheirFormats) {
  const Planned shown = planned(part, {}, "sl1", display());
  EXPECT_EQ(shown.layout.box, CoordBBox(Coord(-30, -15, -3), Coord(69, 44, 8)));
  EXPECT_TRUE(shown.layout.flip_x);
  EXPECT_FALSE(shown.layout.flip_y);
  EXPECT_THAT(shown.warnings, IsEmpty());
  EXPECT_FALSE(planned(part, {.flip_x = true}, "uvj", display()).layout.flip_x);

  const Planned unknown = planned(part, {}, "sl1", {});
  EXPECT_EQ(unknown.layout.box, part);
  EXPECT_THAT(unknown.warnings, ElementsAre("sl1: the slices show the part alone; no --printer "
                                            "tells the size of the display"));
  EXPECT_EQ(planned(part, {.tray = Tray::none, .padding = 1}, "sl1", display()).layout.width(),
            22U);
}

TEST(SliceFrame, TheEmptyRimOfALatticeMayReachBeyondTheTray) {
  const CoordBBox rim(Coord(-16, -16, 0), Coord(20, 20, 8));
  EXPECT_EQ(planned(rim, {.tray = Tray::placed}, "png", display()).layout.box.min().x(), 0);
  const CoordBBox beyond(Coord(-17, -16, 0), Coord(20, 20, 8));
  EXPECT_THAT([&] { planned(beyond, {.tray = Tray::placed}, "png", display()); },
              ThrowsMessage<UsageError>(
                  "--tray: by its coordinates the part lies outside of the display or tray, whose "
                  "corner is at x = y = 0; give --tray centred"));
}

TEST(SliceFrame, WidthsAreMultiplesWhereTheFormatWantsThem) {
  const Planned stack = planned(part, {.padding = 7}, "objet", display());
  EXPECT_EQ(stack.layout.width(), 64U);
  EXPECT_EQ(stack.layout.height(), 24U);
  EXPECT_EQ(stack.layout.box.min().x(), part.min().x());
  EXPECT_EQ(planned(part, {.padding = 6}, "objet", display()).layout.width(), 32U);
}

TEST(SliceFrame, RefusesWhatThereIsNoRoomFor) {
  EXPECT_THAT([&] { planned(part, {.tray = Tray::centred}, "png", {}); },
              ThrowsMessage<UsageError>(HasSubstr("states slice_px or build_mm")));
  EXPECT_THAT(
      [&] { planned(CoordBBox(Coord(0, 0, 0), Coord(132, 9, 9)), {}, "sl1", display()); },
      ThrowsMessage<UsageError>(
          "--tray: the part needs 2.66 x 0.4 mm, and the printer has 2 x 2.4 mm; turn it with "
          "mesh2sdf --rotate, or make it smaller with --fit"));
  EXPECT_THAT([&] { planned(part, {.padding = 1}, "sl1", display()); },
              ThrowsMessage<UsageError>(HasSubstr("or give --tray none")));
  EXPECT_NO_THROW(planned(CoordBBox(Coord(0, 0, 0), Coord((1 << 24) - 1, 9, 9)), {}, "png", {}));
  EXPECT_THAT([&] { planned(CoordBBox(Coord(0, 0, 0), Coord(1 << 24, 9, 9)), {}, "png", {}); },
              ThrowsMessage<UsageError>("slices would be more than 16777216 voxels wide"));
}

TEST(PrinterLimits, MaterialsAndSlicesAreCounted) {
  PrinterProfile printer = display();
  printer.maximum_colours = 2;
  printer.minimum_slices = 30;
  Manifest stack;
  stack.lattice.box = CoordBBox(Coord(0, 0, 0), Coord(9, 9, 29));
  stack.materials = {{"a", {}}, {"b", {}}};
  const SliceFormat& png = *findSliceFormat("png");
  EXPECT_NO_THROW(checkPrinterTakes(png, printer, stack));
  stack.lattice.box.max().z() = 28;
  EXPECT_THAT([&] { checkPrinterTakes(png, printer, stack); },
              ThrowsMessage<UsageError>("--format: A display takes at least 30 slices, and there "
                                        "are 29; the part is too low"));
  EXPECT_THROW(checkPrinterTakes(*findSliceFormat("sl1"), printer, stack), UsageError);
  stack.lattice.box.max().z() = 29;
  stack.materials.push_back({"c", {}});
  for (const char* name : {"png", "png1"}) {
    EXPECT_THAT([&] { checkPrinterTakes(*findSliceFormat(name), printer, stack); },
                ThrowsMessage<UsageError>("--format: A display takes at most 2 materials, and "
                                          "there are 3; assign fewer with material-assign"));
  }
  EXPECT_NO_THROW(checkPrinterTakes(*findSliceFormat("sl1"), printer, stack)) << "shows none";
}

}  // namespace
}  // namespace vdbdither
