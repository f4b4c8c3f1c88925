#include <memory>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "io/profile/material_table.h"
#include "io/profile/printer_profile.h"
#include "tests/support/drawn_grids.h"
#include "tests/support/told.h"
#include "vdbdither/engine/operator.h"
#include "vdbdither/engine/registry.h"
#include "vdbdither/model/errors.h"

namespace vdbdither {
namespace {

using openvdb::Coord;
using openvdb::CoordBBox;
using openvdb::Int32Grid;
using test::drawnMaterial;
using testing::HasSubstr;
using testing::ThrowsMessage;

constexpr const char* mode_refusal = "--material, --parts and --shell exclude each other; give one";

struct Assign {
  explicit Assign(std::vector<std::string> arguments)
      : made(findOperator("material-assign").make()) {
    Options options;
    made->declare(options);
    options.parse(arguments);
  }
  Filter& filter() { return static_cast<Filter&>(*made); }

  std::unique_ptr<Operator> made;
};

Schema schemaOf(const CoordBBox& box) {
  Schema schema;
  schema.lattice = {{0.05, 0.05, 0.05}, {0, 0, 0}, box};
  schema.grids["solid"] = openvdb::BoolGrid::create(false);
  return schema;
}

/// A prototype of the parts of `count` meshes.
Int32Grid::Ptr partGrid(int count) {
  auto grid = Int32Grid::create(0);
  grid->insertMeta(part_count_key, openvdb::Int32Metadata(count));
  return grid;
}

/// The layers of `grid` in its box as they are drawn.
std::vector<std::vector<std::string>> drawing(const GridConstPtr& grid, const CoordBBox& box) {
  const auto values = openvdb::gridConstPtrCast<Int32Grid>(grid);
  std::vector<std::vector<std::string>> layers;
  for (int z = box.min().z(); z <= box.max().z(); ++z) {
    layers.emplace_back();
    for (int y = box.max().y(); y >= box.min().y(); --y) {
      std::string& row = layers.back().emplace_back();
      for (int x = box.min().x(); x <= box.max().x(); ++x) {
        const std::int32_t value = values->tree().getValue(Coord(x, y, z));
        EXPECT_EQ(value != 0, values->tree().isValueOn(Coord(x, y, z)));
        row += value ? static_cast<char>('0' + value) : '.';
      }
    }
  }
  return layers;
}

std::string tableText(Assign assign, const Schema& schema) {
  std::string text;
  for (const Material& material :
       materialTableFromJson(assign.filter().plan(schema).metadata.at(materials_key))) {
    text += material.name + "=" + std::to_string(material.rgba[0]) + " ";
  }
  return text;
}

TEST(MaterialAssign, OneMaterialFillsTheSolid) {
  const std::vector<std::vector<std::string>> layers = {{"11.", ".1."}, {"...", "..1"}};
  const auto drawn = drawnMaterial(layers);
  const CoordBBox box(Coord(0), Coord(2, 1, 1));
  Assign assign({});
  assign.filter().plan(schemaOf(box));
  const Grids out = assign.filter().run({{0, 2}, {0, 2}, {{"solid", test::solidOf(*drawn)}}});
  EXPECT_EQ(drawing(out.at("material"), box), layers);
}

TEST(MaterialAssign, TheDefaultIsThePrintersFirstMaterialElseWhite) {
  Schema schema = schemaOf(CoordBBox(Coord(0), Coord(1)));
  EXPECT_EQ(tableText(Assign({}), schema), "white=240 ");
  PrinterProfile printer;
  printer.pitch_mm = openvdb::Vec3d(0.05);
  printer.materials = {{"Rubber", {1, 2, 3, 255}}, {"white", {9, 9, 9, 255}}};
  schema.metadata["vdbdither:printer"] = toJson(printer);
  EXPECT_EQ(tableText(Assign({}), schema), "Rubber=1 ");
  EXPECT_EQ(tableText(Assign({"--material", "white"}), schema), "white=9 ");
  EXPECT_EQ(tableText(Assign({"--material", "pink=250,100,100"}), schema), "pink=250 ");
}

TEST(MaterialAssign, PlansTheGridAndPassesTheOthersOn) {
  Schema schema = schemaOf(CoordBBox(Coord(0), Coord(1)));
  schema.grids["surface"] = openvdb::FloatGrid::create();
  Assign assign({});
  const Schema out = assign.filter().plan(schema);
  EXPECT_TRUE(out.grids.contains("solid"));
  EXPECT_TRUE(out.grids.contains("surface"));
  EXPECT_EQ(out.grids.at("material")->type(), Int32Grid::gridType());
  EXPECT_EQ(out.grids.at("material")->getName(), "material");
}

TEST(MaterialAssign, ShellsLieOneUnderTheOther) {
  const CoordBBox box(Coord(0), Coord(8, 6, 6));
  auto solid = openvdb::BoolGrid::create(false);
  solid->fill(box, true, true);
  Assign assign({"--shell", "0.05mm:white,100um:ink=1,2,3", "--core", "clear"});
  const Schema out = assign.filter().plan(schemaOf(box));
  EXPECT_EQ(assign.filter().reads()[0].reach.below, 3);
  EXPECT_EQ(assign.filter().reads()[0].reach.above, 3);
  const Grids grids = assign.filter().run({{0, 7}, {0, 7}, {{"solid", solid}}});
  EXPECT_EQ(drawing(grids.at("material"), box)[3],
            (std::vector<std::string>{"111111111", "122222221", "122222221", "122333221",
                                      "122222221", "122222221", "111111111"}));
  EXPECT_EQ(tableText(Assign({"--shell", "0.05mm:white,100um:ink=1,2,3", "--core", "clear"}),
                      schemaOf(box)),
            "white=240 ink=1 clear=227 ");
}

TEST(MaterialAssign, ShellsAgreeForAnySlabHeight) {
  const CoordBBox box(Coord(0), Coord(20, 20, 39));
  auto solid = openvdb::BoolGrid::create(false);
  for (auto voxel = box.begin(); voxel; ++voxel) {
    if (((*voxel).asVec3d() - openvdb::Vec3d(10, 10, 20)).length() < 10)
      solid->tree().setValueOn(*voxel, true);
  }
  Assign assign({"--shell", "0.12mm:white", "--core", "clear"});
  assign.filter().plan(schemaOf(box));
  const auto whole =
      drawing(assign.filter().run({{0, 40}, {0, 40}, {{"solid", solid}}}).at("material"), box);
  const Reach reach = assign.filter().reads()[0].reach;
  for (int z = 0; z < 40; z += 8) {
    const ZRange valid = intersection({z - reach.below, z + 8 + reach.above}, {0, 40});
    const Grids grids = assign.filter().run({{z, z + 8}, valid, {{"solid", solid}}});
    const auto part =
        drawing(grids.at("material"), CoordBBox(Coord(0, 0, z), Coord(20, 20, z + 7)));
    EXPECT_TRUE(std::equal(part.begin(), part.end(), whole.begin() + z)) << z;
  }
}

TEST(MaterialAssign, PartsTakeTheirMaterials) {
  // The solid is one tile, the parts are a leaf and a tile in it, and one voxel belongs to no part.
  auto solid = openvdb::BoolGrid::create(false);
  solid->tree().addTile(2, Coord(0), true, true);
  auto part = Int32Grid::create(0);
  part->tree().addTile(2, Coord(0), 1, true);
  part->fill(CoordBBox(Coord(8, 0, 0), Coord(15, 7, 7)), 2);
  part->tree().setValue(Coord(2, 0, 0), 2);
  part->tree().setValueOff(Coord(3, 0, 0), 0);
  Schema schema = schemaOf(CoordBBox(Coord(0), Coord(127)));
  schema.grids["part"] = Int32Grid::create(0);
  Assign assign({"--parts", "black,white"});
  assign.filter().plan(schema);
  const Grids grids = assign.filter().run({{0, 128}, {0, 128}, {{"solid", solid}, {"part", part}}});
  EXPECT_EQ(drawing(grids.at("material"), CoordBBox(Coord(0), Coord(17, 0, 0)))[0][0],
            "112211112222222211");
  EXPECT_EQ(drawing(grids.at("material"), CoordBBox(Coord(120, 127, 127), Coord(127)))[0][0],
            "11111111");
}

TEST(MaterialAssign, MaterialsListedTwiceAreOneEntryOfTheTable) {
  const CoordBBox box(Coord(0), Coord(8, 6, 6));
  auto solid = openvdb::BoolGrid::create(false);
  solid->fill(box, true, true);
  const std::vector<std::string> shell = {"--shell", "0.05mm:white,100um:ink=1,2,3", "--core",
                                          "white=240,240,240"};
  EXPECT_EQ(tableText(Assign(shell), schemaOf(box)), "white=240 ink=1 ");
  Assign assign(shell);
  assign.filter().plan(schemaOf(box));
  EXPECT_EQ(
      drawing(assign.filter().run({{0, 7}, {0, 7}, {{"solid", solid}}}).at("material"), box)[3],
      (std::vector<std::string>{"111111111", "122222221", "122222221", "122111221", "122222221",
                                "122222221", "111111111"}));

  const auto part = drawnMaterial({{"123"}});
  Schema schema = schemaOf(CoordBBox(Coord(0), Coord(2, 0, 0)));
  schema.grids["part"] = partGrid(3);
  EXPECT_EQ(tableText(Assign({"--parts", "clear,white,clear"}), schema), "clear=227 white=240 ");
  Assign parts({"--parts", "clear,white,Clear"});
  parts.filter().plan(schema);
  const Grids grids =
      parts.filter().run({{0, 1}, {0, 1}, {{"solid", test::solidOf(*part)}, {"part", part}}});
  EXPECT_EQ(drawing(grids.at("material"), schema.lattice.box)[0][0], "121");
}

TEST(MaterialAssign, EachPartHasAMaterial) {
  Schema schema = schemaOf(CoordBBox(Coord(0), Coord(2, 0, 0)));
  schema.grids["part"] = partGrid(3);
  const auto planned = [&](const std::string& parts) {
    return [&schema, parts] { Assign({"--parts", parts}).filter().plan(schema); };
  };
  EXPECT_NO_THROW(planned("white,white,black")());
  EXPECT_THAT(planned("white,black"),
              ThrowsMessage<UsageError>("--parts: 2 materials for 3 parts; name one for "
                                        "each, in the order of the meshes"));
  EXPECT_THAT(planned("white"), ThrowsMessage<UsageError>(HasSubstr("1 material for 3 parts")));
  EXPECT_THAT(planned("white,black,white,cyan"),
              ThrowsMessage<UsageError>(HasSubstr("4 materials for 3 parts")));
}

TEST(MaterialAssign, WarnsWhereTheNumberOfPartsIsNotKnown) {
  Schema schema = schemaOf(CoordBBox(Coord(0), Coord(2, 0, 0)));
  schema.grids["part"] = Int32Grid::create(0);
  Assign assign({"--parts", "white,black"});
  test::Listener listener;
  assign.made->setReporter(&listener);
  assign.filter().plan(schema);
  EXPECT_THAT(listener.warnings,
              testing::ElementsAre("the grid 'part' does not say how many parts there are (its "
                                   "metadata vdbdither:parts); those beyond the 2 materials of "
                                   "--parts take the last one"));
}

TEST(MaterialAssign, AnEmptySlabIsFine) {
  const CoordBBox box(Coord(0), Coord(20));
  for (const std::vector<std::string>& arguments : {std::vector<std::string>{},
                                                    {"--shell", "0.1:white", "--core", "clear"},
                                                    {"--parts", "white"}}) {
    Schema schema = schemaOf(box);
    schema.grids["part"] = Int32Grid::create(0);
    Assign assign(arguments);
    assign.filter().plan(schema);
    const Grids grids = assign.filter().run(
        {{0, 8},
         {0, 8},
         {{"solid", openvdb::BoolGrid::create(false)}, {"part", Int32Grid::create(0)}}});
    EXPECT_TRUE(grids.at("material")->empty());
  }
}

TEST(MaterialAssign, RefusesWhatItCannotAssign) {
  const Schema schema = schemaOf(CoordBBox(Coord(0), Coord(1)));
  const auto planned = [&](const std::vector<std::string>& arguments) {
    return [&schema, arguments] { Assign(arguments).filter().plan(schema); };
  };
  EXPECT_THAT(planned({"--shell", "1:white"}),
              ThrowsMessage<UsageError>("--shell and --core go together; give both"));
  EXPECT_THAT(planned({"--core", "white"}),
              ThrowsMessage<UsageError>("--shell and --core go together; give both"));
  EXPECT_THAT(planned({"--material", "white", "--parts", "white"}),
              ThrowsMessage<UsageError>(mode_refusal));
  EXPECT_THAT(planned({"--shell", "white", "--core", "clear"}),
              ThrowsMessage<UsageError>(
                  "--shell: 'white' must be a thickness and a material, as in 0.5mm:white"));
  EXPECT_THAT(planned({"--shell", "0:white", "--core", "clear"}),
              ThrowsMessage<UsageError>("--shell: '0' is not accepted; the length must be greater "
                                        "than 0 mm, up to 1000 mm"));
  EXPECT_THAT(planned({"--shell", "1:a=#000000", "--core", "a=#ffffff"}),
              ThrowsMessage<UsageError>("--core: 'a' has two colours; give one another name"));
  EXPECT_THAT(planned({"--shell", "1:a=#000000", "--core", "A=#000000"}),
              ThrowsMessage<UsageError>("--core: 'a' and 'A' differ by upper and lower case only; "
                                        "give one another name"));
  EXPECT_THAT(planned({"--material", "pink"}),
              ThrowsMessage<UsageError>(HasSubstr("--material: no material 'pink'; there are")));
  EXPECT_THAT(planned({"--parts", "white"}), ThrowsMessage<DataError>(HasSubstr("no grid 'part'")));
  Schema empty = schema;
  empty.grids.clear();
  EXPECT_THAT([&] { Assign({}).filter().plan(empty); },
              ThrowsMessage<DataError>(HasSubstr("no grid 'solid'")));
}

}  // namespace
}  // namespace vdbdither
