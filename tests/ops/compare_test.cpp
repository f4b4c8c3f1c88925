#include <filesystem>
#include <memory>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "io/vdb/vdb.h"
#include "tests/support/drawn_grids.h"
#include "tests/support/scratch_folder.h"
#include "tests/support/sinks.h"
#include "vdbdither/model/errors.h"

namespace vdbdither {
namespace {

using nlohmann::json;
using openvdb::Coord;
using openvdb::CoordBBox;
using testing::HasSubstr;
using testing::ThrowsMessage;

Schema schemaOf(const Grids& grids, const CoordBBox& box) {
  Schema schema;
  schema.lattice = {{1, 1, 1}, {0, 0, 0}, box};
  for (const auto& [name, grid] : grids) schema.grids[name] = grid->copyGridWithNewTree();
  return schema;
}

/// Floats with 1.5 in two voxels, on a background of 3.
openvdb::FloatGrid::Ptr values() {
  auto grid = openvdb::FloatGrid::create(3);
  grid->tree().setValue(Coord(1, 2, 3), 1.5F);
  grid->tree().setValue(Coord(4, 4, 20), 1.5F);
  return grid;
}

class Compare : public testing::Test {
 protected:
  void SetUp() override { initializeVdb(); }

  void writeOther(const Grids& grids, const CoordBBox& box) {
    writeVdb(other_, contentsOf(schemaOf(grids, box), grids), VdbCodec::blosc, other_);
  }

  /// What is told of `grids`; where they differ from the other ones, why.
  std::string told(const Grids& grids, const CoordBBox& box,
                   std::vector<std::string> arguments = {}, int height = 8) {
    arguments.push_back(other_);
    const test::SinkCalled compare("compare", arguments);
    try {
      compare.run(schemaOf(grids, box), grids, height);
    } catch (const DataError& error) {
      return compare.said.printed + error.what();
    }
    return compare.said.printed;
  }

  test::ScratchFolder scratch_;
  std::string other_ = scratch_ / "other.vdb";
};

TEST_F(Compare, EqualGridsAreEqualForAnySlabsAndBoxes) {
  writeOther({{"a", values()}}, {Coord(0), Coord(31)});
  for (const int height : {8, 16, 64})
    EXPECT_EQ(told({{"a", values()}}, {Coord(0), Coord(31)}, {}, height), "equal\n");
  EXPECT_EQ(told({{"a", values()}}, {Coord(-20), Coord(60)}), "equal\n");
  EXPECT_EQ(told({{"a", values()}}, {Coord(1, 2, 3), Coord(4, 4, 20)}), "equal\n");
}

TEST_F(Compare, WhatOnlyTheOtherBoxHoldsDiffers) {
  writeOther({{"a", values()}}, {Coord(0), Coord(31)});
  auto less = values();
  less->tree().setValueOff(Coord(4, 4, 20), 3);
  EXPECT_THAT(told({{"a", less}}, {Coord(0), Coord(7)}),
              HasSubstr("grid 'a' in 1 voxels, first at 4 4 20, by at most 1.5"));
}

TEST_F(Compare, DifferencesAreCountedAndTheFirstIsNamed) {
  writeOther({{"a", values()}}, {Coord(0), Coord(31)});
  auto changed = values();
  changed->tree().setValue(Coord(4, 4, 20), 1.25F);
  changed->tree().setValue(Coord(0, 0, 21), 3);
  EXPECT_EQ(
      told({{"a", changed}}, {Coord(0), Coord(31)}),
      "not equal to '" + other_ + "': grid 'a' in 2 voxels, first at 4 4 20, by at most 0.25");
  const std::string text = told({{"a", changed}}, {Coord(0), Coord(31)}, {"--json"});
  const json found = json::parse(text.substr(0, text.find('\n')));
  EXPECT_EQ(found["equal"], false);
  EXPECT_EQ(found["grids"][0]["voxels"], 2);
  EXPECT_EQ(found["grids"][0]["first"], json::parse("[4, 4, 20]"));
  EXPECT_EQ(found["grids"][0]["largest"], 0.25);
  // The state still differs.
  EXPECT_THAT(told({{"a", changed}}, {Coord(0), Coord(31)}, {"--tolerance", "0.3"}),
              HasSubstr("in 1 voxels, first at 0 0 21, by at most 0"));
}

TEST_F(Compare, KindsOfGridsAreToldApart) {
  const CoordBBox box(Coord(0), Coord(31));
  auto class_of_its_own = values();
  class_of_its_own->setGridClass(openvdb::GRID_LEVEL_SET);
  writeOther({{"a", values()}, {"b", values()}}, box);
  EXPECT_THAT(told({{"a", values()}}, box), HasSubstr("grid 'b' is there alone"));
  EXPECT_THAT(told({{"a", values()}, {"b", values()}, {"c", values()}}, box),
              HasSubstr("grid 'c' is missing there"));
  EXPECT_THAT(told({{"a", openvdb::BoolGrid::create()}, {"b", values()}}, box),
              HasSubstr("grid 'a' is of bool, there of float"));
  EXPECT_THAT(told({{"a", class_of_its_own}, {"b", values()}}, box),
              HasSubstr("grid 'a' is of class level set, there of unknown"));
  EXPECT_EQ(told({{"a", values()}}, box, {"--grids", "a"}), "equal\n");
  EXPECT_THAT(
      [&] {
        told({{"a", values()}}, box, {"--grids", "z"});
      },
      ThrowsMessage<UsageError>("no grid 'z' in either"));
}

}  // namespace
}  // namespace vdbdither
