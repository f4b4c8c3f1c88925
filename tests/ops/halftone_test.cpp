#include <algorithm>
#include <map>
#include <memory>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "io/profile/material_table.h"
#include "io/profile/printer_profile.h"
#include "tests/support/contract.h"
#include "tests/support/volumes.h"
#include "vdbdither/engine/operator.h"
#include "vdbdither/engine/registry.h"
#include "vdbdither/model/errors.h"
#include "vdbdither/model/known_grids.h"
#include "vdbdither/model/openvdb.h"

namespace vdbdither {
namespace {

using openvdb::Coord;
using openvdb::CoordBBox;
using openvdb::FloatGrid;
using openvdb::Int32Grid;
using openvdb::Vec3SGrid;
using testing::HasSubstr;
using testing::ThrowsMessage;

struct Planned {
  Planned(const std::string& verb, std::vector<std::string> arguments)
      : made(findOperator(verb).make()) {
    Options options;
    made->declare(options);
    options.parse(arguments);
  }
  Filter& filter() { return static_cast<Filter&>(*made); }

  std::unique_ptr<Operator> made;
};

const CoordBBox box(Coord(0), Coord(15));

Schema schemaWith(const std::vector<std::string>& grids) {
  Schema schema;
  schema.lattice = {{0.05, 0.05, 0.05}, {0, 0, 0}, box};
  schema.grids["solid"] = openvdb::BoolGrid::create(false);
  for (const std::string& name : grids) {
    if (name == "Cd") {
      schema.grids[name] = Vec3SGrid::create();
    } else {
      schema.grids[name] = FloatGrid::create();
    }
  }
  PrinterProfile printer;
  printer.name = "printer";
  printer.pitch_mm = openvdb::Vec3d(0.05);
  printer.materials = {{"VeroPureWht", {240, 240, 240, 255}},
                       {"VeroBlack", {26, 26, 29, 255}},
                       {"VeroClear", {227, 233, 253, 255}},
                       {"VeroCyan", {0, 90, 158, 255}}};
  schema.metadata[printer_key] = toJson(printer);
  return schema;
}

const std::vector<std::string> small_mask = {"--size", "8"};

void expectRefusal(const std::string& verb, std::vector<std::string> arguments,
                   const Schema& schema, const std::string& message) {
  if (verb == "halftone") arguments.insert(arguments.end(), small_mask.begin(), small_mask.end());
  EXPECT_THAT([&] { Planned(verb, arguments).filter().plan(schema); },
              ThrowsMessage<Error>(HasSubstr(message)));
}

TEST(Halftone, ListsTheMaterialsOfTheProfile) {
  const Schema out = Planned("halftone", small_mask).filter().plan(schemaWith({"Cd"}));
  const MaterialTable table = materialTableFromJson(out.metadata.at(materials_key));
  ASSERT_EQ(table.size(), 4U);
  EXPECT_EQ(table[3].name, "VeroCyan");
}

TEST(Halftone, RefusesWhatItCannotDo) {
  const Schema colours = schemaWith({"Cd"});
  expectRefusal("halftone", {}, schemaWith({}),
                "no colours: there must be the grid 'Cd' (mesh2sdf --colour makes it), grids named "
                "coverage_ and a material, or those that --coverages names");
  expectRefusal("halftone", {"--inks", "white,blck"}, colours, "--inks: no material 'blck'");
  expectRefusal("halftone", {"--inks", "white,black,white"}, colours,
                "--inks: 'white' is there twice");
  expectRefusal("halftone", {"--inks", "white,ink=#000000,Ink=#ff0000"}, colours,
                "--inks: 'ink' and 'Ink' differ by upper and lower case only");
  expectRefusal("halftone", {"--inks", "white,ink=#000000,ink=#ff0000"}, colours,
                "--inks: 'ink' has two colours; give one another name");
  expectRefusal("halftone", {"--inks", "white,black,cyan,magenta,yellow"}, colours,
                "--inks: there are 5 materials, and the printer takes 4");
  expectRefusal("halftone", {"--inks", "clear"}, colours,
                "--inks: there must be an ink besides the clear one");
  expectRefusal("halftone", {"--inks", "clear,white,VeroClear"}, colours,
                "--inks: 'clear' and 'VeroClear' are both clear; name one of them");
  expectRefusal("halftone", {"--core", "yellow"}, colours,
                "--core: no ink 'yellow'; there are VeroPureWht VeroBlack VeroClear VeroCyan");
  expectRefusal("halftone", {"--coat", "clear"}, colours,
                "--coat: 'clear' must be a thickness and a material, as in 0.1mm:VeroClear");
  expectRefusal("halftone", {"--coat", "thick:VeroClear"}, colours, "--coat: 'thick' ");
  expectRefusal("halftone", {"--coat", "1mm:glass"}, colours, "--coat: no ink 'glass'; there are");
  expectRefusal("halftone", {"--rest", "VeroPureWht"}, colours,
                "--rest: colours have no rest; leave it out");
  expectRefusal("halftone", {"--coverages", "density"}, colours,
                "--coverages: 'density' must be a grid and a material, as in density=black");
  expectRefusal("halftone", {"--coverages", "=black"}, colours,
                "--coverages: '=black' must be a grid and a material");
  expectRefusal("halftone", {"--coverages", "density=VeroBlack,density=VeroCyan"},
                schemaWith({"density"}), "--coverages: 'density' is there twice");
  expectRefusal("halftone", {"--coverages", "density=black"}, colours, "no grid 'density'");
  expectRefusal("halftone", {"--coverages", "density=blue"}, schemaWith({"density"}),
                "--coverages: no ink 'blue'");
  expectRefusal("halftone", {"--icc", "inks.icc"}, schemaWith({"coverage_VeroCyan"}), "--icc: ");
  expectRefusal("halftone", {"--icc", "no such.icc"}, colours, "--icc: no such file 'no such.icc'");
  expectRefusal("halftone", {"--channels", "cyan"}, colours,
                "--channels: belongs to --icc; leave it out, or give that too");
  expectRefusal("halftone", {"--intent", "saturation"}, colours, "--intent: belongs to --icc; ");
  expectRefusal("separate", {"--black-point", "kept"}, colours, "--black-point: belongs to --icc");
  expectRefusal("halftone", {"--icc", "inks.icc", "--black", "0"}, colours,
                "--black: the profile of --icc says it; leave it out");
  expectRefusal("halftone", {"--white", "absolute"}, schemaWith({"coverage_VeroCyan"}),
                "--white: coverages are not separated again; leave it out");
  expectRefusal("halftone", {"--parts", "colours,VeroClear"}, colours, "no grid 'part'");
  Schema parts = colours;
  const auto part = Int32Grid::create();
  part->insertMeta(part_count_key, openvdb::Int32Metadata(2));
  parts.grids["part"] = part;
  expectRefusal("halftone", {"--parts", "glass,colours"}, parts, "--parts: no ink 'glass'; there");
  expectRefusal("halftone", {"--parts", "colours"}, parts, "--parts: 1 material for 2 parts; ");
  expectRefusal("halftone", {"--mask", "white"}, colours,
                "--size: only --mask blue has it; leave it out");
  Schema bare = colours;
  bare.metadata.clear();
  expectRefusal("halftone", {}, bare,
                "--inks: no printer profile names materials; name them, as in "
                "white,black,cyan,magenta,yellow");
  expectRefusal("separate", {}, schemaWith({}), "no grid 'Cd'");
}

TEST(Halftone, TakesTheCoveragesThatSeparateMakes) {
  const Schema colours = schemaWith({"Cd"});
  Planned separate("separate", {});
  Planned direct("halftone", small_mask);
  Planned second("halftone", small_mask);
  const Schema separated = separate.filter().plan(colours);
  EXPECT_TRUE(separated.grids.contains("coverage_VeroBlack"));
  direct.filter().plan(colours);
  second.filter().plan(separated);

  const auto solid = openvdb::BoolGrid::create(false);
  solid->fill(box, true, true);
  const auto colour = Vec3SGrid::create();
  for (auto ijk = box.begin(); ijk; ++ijk)
    if ((*ijk).x() < 12)
      colour->tree().setValue(*ijk,
                              openvdb::Vec3s(0.3F, 0.05F * static_cast<float>((*ijk).y()), 0.5F));
  Slab slab{{0, 16}, {0, 16}, {{"solid", solid}, {"Cd", colour}}};
  const Grids expected = direct.filter().run(slab);
  for (const auto& [name, grid] : separate.filter().run(slab)) slab.grids[name] = grid;
  slab.grids.erase("Cd");
  const Grids found = second.filter().run(slab);
  const auto materials = [](const Grids& grids) {
    return openvdb::gridConstPtrCast<Int32Grid>(grids.at("material"));
  };
  int differences = 0;
  std::map<std::int32_t, int> used;
  for (auto ijk = box.begin(); ijk; ++ijk) {
    const std::int32_t material = materials(expected)->tree().getValue(*ijk);
    ++used[material];
    differences += material != materials(found)->tree().getValue(*ijk) ? 1 : 0;
    if ((*ijk).x() >= 12) {
      ASSERT_EQ(material, 1);
    }
  }
  EXPECT_EQ(differences, 0);
  EXPECT_GT(used[2], 100);
  EXPECT_GT(used[4], 100);
  EXPECT_EQ(used[3], 0);
}

TEST(Halftone, TakesTheTableOfTheCoveragesWhereItHasThem) {
  Schema in = schemaWith({"coverage_VeroBlue 5"});
  in.metadata[materials_key] =
      toJson(MaterialTable{{"VeroBlue 5", {0, 0, 200, 255}}, {"white", {255, 255, 255, 255}}});
  const auto names = [](const Schema& out) {
    std::string text;
    for (const Material& ink : materialTableFromJson(out.metadata.at(materials_key)))
      text += ink.name + " ";
    return text;
  };
  EXPECT_EQ(names(Planned("halftone", small_mask).filter().plan(in)), "VeroBlue 5 white ");
  in.grids.erase("coverage_VeroBlue 5");
  in.grids["coverage_VeroCyan"] = FloatGrid::create();
  EXPECT_EQ(names(Planned("halftone", small_mask).filter().plan(in)),
            "VeroPureWht VeroBlack VeroClear VeroCyan ");
}

TEST(Separate, LeavesNoCoveragesOfBefore) {
  const Schema in = schemaWith({"Cd", "coverage_old"});
  const Schema out = Planned("separate", {}).filter().plan(in);
  EXPECT_FALSE(out.grids.contains("coverage_old"));
  EXPECT_TRUE(out.grids.contains("coverage_VeroCyan"));
}

TEST(Halftone, ACoatLiesOverTheColours) {
  Planned planned("halftone", {"--coat", "0.1mm:VeroClear", "--size", "8"});
  Schema in = schemaWith({"Cd"});
  in.lattice.box = CoordBBox(Coord(-2), Coord(42));
  in.grids["solid"] = openvdb::BoolGrid::create(false);
  planned.filter().plan(in);
  const CoordBBox part(Coord(0), Coord(39));
  const auto solid = openvdb::BoolGrid::create(false);
  solid->fill(part, true, true);
  const auto colour = Vec3SGrid::create();
  colour->fill(part, openvdb::Vec3s(0.01F), true);
  const Grids whole{{"solid", solid}, {"Cd", colour}};
  const Grids out = planned.filter().run({{-2, 43}, {-2, 43}, whole});
  const auto material = openvdb::gridConstPtrCast<Int32Grid>(out.at("material"));
  // Voxels of 50 µm: the two outer layers.
  for (auto ijk = in.lattice.box.begin(); ijk; ++ijk) {
    const Coord low = *ijk - part.min();
    const Coord high = part.max() - *ijk;
    const int depth = std::min({low.x(), low.y(), low.z(), high.x(), high.y(), high.z()});
    const std::int32_t found = material->tree().getValue(*ijk);
    if (depth < 0) {
      ASSERT_EQ(found, 0) << *ijk;
    } else {
      ASSERT_EQ(found == 3, depth < 2) << *ijk << " is " << found;
    }
  }
  EXPECT_EQ(test::firstBreach(planned.filter(), in, whole, 8), "");
}

TEST(Halftone, EveryFlatTopHasTheSamePatternIfThereIsASurface) {
  constexpr float grey = 0.2F;
  Schema in = schemaWith({"Cd"});
  in.lattice.box = CoordBBox(Coord(-8), Coord(60));
  // A step: tops at 20 and at 41 layers.
  const auto d = [](const openvdb::Vec3d& at) {
    const double top_mm = at.x() < 23.5 * 0.05 ? 20.5 * 0.05 : 41.5 * 0.05;
    return std::max({at.z() - top_mm, -0.025 - at.z(), -0.025 - at.x(), at.x() - 54.5 * 0.05});
  };
  const auto surface = test::sampled(d, in.lattice, 0.3);
  const auto solid = openvdb::BoolGrid::create(false);
  const auto colour = Vec3SGrid::create();
  for (auto ijk = in.lattice.box.begin(); ijk; ++ijk) {
    if (surface->tree().getValue(*ijk) >= 0) continue;
    solid->tree().setValueOn(*ijk, true);
    colour->tree().setValue(*ijk, openvdb::Vec3s(grey));
  }
  // Voxels `depth` layers below one top that differ from those below the other.
  const auto unlike = [&](const Grids& grids, int depth, const std::string& coat) {
    for (const auto& [name, grid] : grids) in.grids[name] = grid->copyGridWithNewTree();
    std::vector<std::string> arguments{"--size", "16"};
    if (!coat.empty()) arguments.insert(arguments.end(), {"--coat", coat});
    Planned planned("halftone", arguments);
    planned.filter().plan(in);
    EXPECT_EQ(test::firstBreach(planned.filter(), in, grids, 8), "");
    const auto material = openvdb::gridConstPtrCast<Int32Grid>(
        planned.filter().run({{-8, 61}, {-8, 61}, grids}).at("material"));
    int count = 0;
    for (int y = 8; y < 40; ++y)
      for (int x = 9; x < 14; ++x)
        count += material->tree().getValue(Coord(x, y, 20 - depth)) !=
                         material->tree().getValue(Coord(x + 32, y, 41 - depth))
                     ? 1
                     : 0;
    return count;
  };
  EXPECT_GT(unlike({{"solid", solid}, {"Cd", colour}}, 0, ""), 20);
  const Grids grids{{"surface", surface}, {"solid", solid}, {"Cd", colour}};
  for (int depth = 0; depth < 3; ++depth) EXPECT_EQ(unlike(grids, depth, ""), 0) << depth;
  EXPECT_GT(unlike(grids, 5, ""), 20);
  // A coat of four layers lies over as many layers of columns.
  for (int depth = 0; depth < 7; ++depth)
    EXPECT_EQ(unlike(grids, depth, "0.2mm:VeroClear"), 0) << depth;
}

TEST(Halftone, PartsHaveAMaterialOrTheirColours) {
  const CoordBBox part_box(Coord(0), Coord(15));
  const auto solid = openvdb::BoolGrid::create(false);
  solid->fill(part_box, true, true);
  const auto colour = Vec3SGrid::create();
  colour->fill(part_box, openvdb::Vec3s(0.01F), true);
  // Two parts share leaves; a third is a tile; a layer belongs to none.
  const auto part = Int32Grid::create(0);
  part->insertMeta(part_count_key, openvdb::Int32Metadata(3));
  part->fill(CoordBBox(Coord(0), Coord(15, 15, 3)), 1, true);
  part->fill(CoordBBox(Coord(0, 0, 4), Coord(15, 15, 6)), 2, true);
  part->fill(CoordBBox(Coord(0, 0, 8), Coord(15)), 3, true);
  const Grids whole{{"solid", solid}, {"Cd", colour}, {"part", part}};
  Schema in = schemaWith({"Cd"});
  in.grids["part"] = part->copyGridWithNewTree();
  const auto halftoned = [&](const std::vector<std::string>& more) {
    std::vector<std::string> arguments{"--size", "8"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    Planned planned("halftone", arguments);
    planned.filter().plan(in);
    EXPECT_EQ(test::firstBreach(planned.filter(), in, whole, 8), "");
    return openvdb::gridConstPtrCast<Int32Grid>(
        planned.filter().run({{0, 16}, {0, 16}, whole}).at("material"));
  };
  const auto all = halftoned({});
  const auto some = halftoned({"--parts", "VeroCyan,colours,VeroClear"});
  const auto same = halftoned({"--parts", "colours,colours,colours"});
  for (auto ijk = part_box.begin(); ijk; ++ijk) {
    const std::int32_t coloured = all->tree().getValue(*ijk);
    const int z = (*ijk).z();
    const std::int32_t expected = z < 4 ? 4 : z < 8 ? coloured : 3;
    ASSERT_EQ(some->tree().getValue(*ijk), expected) << *ijk;
    ASSERT_EQ(same->tree().getValue(*ijk), coloured) << *ijk;
  }
}

TEST(MaterialAssign, HalftonesColoursUnlessTheCommandLineNamesAMaterial) {
  const Schema colours = schemaWith({"Cd"});
  const auto materials = [&](std::vector<std::string> arguments) {
    const Schema out = Planned("material-assign", arguments).filter().plan(colours);
    return materialTableFromJson(out.metadata.at(materials_key)).size();
  };
  EXPECT_EQ(materials({}), 4U);
  Schema clear = colours;
  PrinterProfile printer = printerProfileFromJson(colours.metadata.at(printer_key));
  printer.materials = {{"clear", {227, 233, 253, 255}}};
  clear.metadata[printer_key] = toJson(printer);
  EXPECT_TRUE(Planned("material-assign", {}).filter().plan(clear).grids.contains("material"));
  EXPECT_EQ(materials({"--material", "black"}), 1U);
  EXPECT_EQ(materials({"--shell", "0.5mm:white", "--core", "black"}), 2U);
}

}  // namespace
}  // namespace vdbdither
