#include "vdbdither/engine/option_groups.h"

#include <gtest/gtest.h>

namespace vdbdither {
namespace {

using Words = std::vector<std::string>;

TEST(OptionGroups, PlacementTurnsTheNumbersOfAFileIntoMm) {
  MeshPlacementOptions placement;
  Options options;
  placement.declare(options, "the mesh");
  EXPECT_EQ(placement.mmPerUnit(), 1);
  for (const auto& [unit, mm] :
       {std::pair("mm", 1.0), {"cm", 10.0}, {"m", 1000.0}, {"in", 25.4}, {"um", 0.001}}) {
    options.parse(Words{"--unit", unit, "--scale", "0.5"});
    EXPECT_EQ(placement.mmPerUnit(), mm * 0.5) << unit;
  }
  options.parse(Words{"--fit", "2cm", "--rotate", "90,0,0", "--place"});
  EXPECT_EQ(placement.fit_mm, 20);
  EXPECT_EQ(placement.rotate_degrees, openvdb::Vec3d(90, 0, 0));
  EXPECT_TRUE(placement.on_bed);
}

TEST(OptionGroups, ALatticeIsAPrinterOrAPitch) {
  LatticeOptions lattice;
  Options options;
  lattice.declare(options);
  EXPECT_EQ(options.canonical(), "");
  options.parse(Words{"--pitch", "42um,84um,22um"});
  EXPECT_EQ(lattice.pitch_mm, openvdb::Vec3d(0.042, 0.084, 0.022));
  EXPECT_EQ(options.find("printer")->completion, Option::Completion::printer);
  options.parse(Words{"--printer", "p", "--layer", "30um"});
  EXPECT_EQ(lattice.layer_mm, 0.03);
}

TEST(OptionGroups, ListsOfGridsAreEmptyWhereAllAreMeant) {
  GridListOption grids;
  Options options;
  grids.declare(options);
  EXPECT_EQ(grids.list(), Words{});
  options.parse(Words{"--grids", "solid,N"});
  EXPECT_EQ(grids.list(), (Words{"solid", "N"}));
}

TEST(OptionGroups, TheSurfaceIsThatOfTheNamedGridOrLeftOpen) {
  SurfaceGridOption surface;
  Options options;
  surface.declare(options);
  EXPECT_EQ(surface.grid, std::nullopt);
  options.parse(Words{"--grid", "solid"});
  EXPECT_EQ(surface.grid, "solid");
  options.parse(Words{"--grid", "auto"});
  EXPECT_EQ(surface.grid, std::nullopt);
}

}  // namespace
}  // namespace vdbdither
