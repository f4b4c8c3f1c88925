#include "vdbdither/model/known_grids.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <openvdb/openvdb.h>

#include "vdbdither/model/schema.h"

namespace vdbdither {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

Schema schemaOf(const std::vector<std::string>& names) {
  Schema schema;
  for (const std::string& name : names) schema.grids[name] = openvdb::FloatGrid::create();
  return schema;
}

std::vector<std::string> namesOf(const Schema& schema) {
  std::vector<std::string> names;
  for (const auto& [name, grid] : schema.grids) names.push_back(name);
  return names;
}

Schema everything() {
  return schemaOf({"surface", "N", "closest", "part", "Cd", "Alpha", "coverage_red", "displaced",
                   "solid", "material", "printed", "bumps"});
}

TEST(KnownGrids, AChangedSurfaceLeavesWhatIsOfThePartAndWhatIsUnknown) {
  EXPECT_THAT(namesOf(withoutOutdated(everything(), surface_grid)),
              ElementsAre("Alpha", "Cd", "bumps", "coverage_red", "part", "surface"));
}

TEST(KnownGrids, AChangedSolidOutdatesMaterialsAndThePrintOnly) {
  EXPECT_THAT(namesOf(withoutOutdated(everything(), solid_grid)),
              ElementsAre("Alpha", "Cd", "N", "bumps", "closest", "coverage_red", "displaced",
                          "part", "solid", "surface"));
}

TEST(KnownGrids, AreOutdatedWhereWhatTheyDescribeIsAnotherGrid) {
  const Schema before = everything();
  Schema after = withoutOutdated(before, surface_grid);
  EXPECT_THAT(outdatedGrids(before, after), IsEmpty()) << "the surface is the same";
  after.grids["surface"] = openvdb::FloatGrid::create();
  EXPECT_THAT(outdatedGrids(before, after),
              ElementsAre("displaced", "material", "printed", "solid"));
  after.grids.erase("surface");
  EXPECT_THAT(outdatedGrids(before, after), IsEmpty()) << "the surface ends, too";
}

TEST(KnownGrids, AMaterialWithoutItsSolidIsOutdatedByANewSolid) {
  const Schema before = schemaOf({"surface", "material"});
  Schema after = withoutOutdated(before, solid_grid);
  after.grids["solid"] = openvdb::FloatGrid::create();
  EXPECT_THAT(outdatedGrids(before, after), ElementsAre("material"));
}

}  // namespace
}  // namespace vdbdither
