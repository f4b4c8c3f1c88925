#include <memory>
#include <numbers>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "io/profile/material_table.h"
#include "tests/support/drawn_grids.h"
#include "tests/support/sinks.h"
#include "tests/support/volumes.h"
#include "vdbdither/model/errors.h"

namespace vdbdither {
namespace {

using nlohmann::json;
using openvdb::Coord;
using openvdb::CoordBBox;
using openvdb::Vec3d;
using testing::HasSubstr;
using testing::ThrowsMessage;

const Vec3d pitch_mm{0.5, 0.25, 2};

struct Job {
  Schema schema;
  Grids grids;
};

Job jobOf(Grids grids, const CoordBBox& box) {
  Job job;
  job.schema.lattice = {pitch_mm, {0, 0, 0}, box};
  for (const auto& [name, grid] : grids) job.schema.grids[name] = grid->copyGridWithNewTree();
  job.schema.metadata[materials_key] =
      toJson({{"white", {240, 240, 240, 255}}, {"black", {26, 26, 29, 255}}});
  job.grids = std::move(grids);
  return job;
}

std::string told(const Job& job, const std::vector<std::string>& arguments, int height = 8) {
  const test::SinkCalled stats("stats", arguments);
  stats.run(job.schema, job.grids, height);
  return stats.said.printed;
}

TEST(Stats, CountsVoxelsVolumesAndFacesOfEachMaterial) {
  const auto material = test::drawnMaterial({{"11.", ".2."}, {"...", "12."}});
  const json stats =
      json::parse(told(jobOf({{"material", material}}, {Coord(0), Coord(2, 1, 1)}), {"--json"}));
  EXPECT_DOUBLE_EQ(stats["voxel_mm3"], 0.25);
  const json& white = stats["materials"][0];
  EXPECT_EQ(white["name"], "white");
  EXPECT_EQ(white["voxels"], 3);
  EXPECT_DOUBLE_EQ(white["ml"], 3 * 0.25 / 1000);
  // Of the two above in the lower layer 2 faces across x, 3 across y (black is behind one) and 4
  // across z; of the one in the upper layer 1, 2 and 2.
  EXPECT_DOUBLE_EQ(white["faces_mm2"], 3 * 0.25 * 2 + 5 * 0.5 * 2 + 6 * 0.5 * 0.25);
  const json& black = stats["materials"][1];
  EXPECT_EQ(black["voxels"], 2);
  EXPECT_DOUBLE_EQ(black["faces_mm2"], 3 * 0.25 * 2 + 3 * 0.5 * 2 + 2 * 0.5 * 0.25);
}

TEST(Stats, SolidHasTheFacesOfItsVoxels) {
  auto solid = openvdb::BoolGrid::create(false);
  const CoordBBox block(Coord(-3, 2, 5), Coord(10, 20, 30));
  solid->fill(block, true, true);
  const Job job = jobOf({{"solid", solid}}, {Coord(-5), Coord(40)});
  for (const int height : {8, 64}) {
    const json stats = json::parse(told(job, {"--json"}, height));
    EXPECT_EQ(stats["solid"]["voxels"], block.volume());
    const Vec3d size = block.dim().asVec3d() * pitch_mm;
    EXPECT_NEAR(stats["solid"]["faces_mm2"],
                2 * (size.x() * size.y() + size.y() * size.z() + size.z() * size.x()), 1e-9);
  }
}

TEST(Stats, TheAreaOfASphereIsThatOfASphereWhateverTheSlabs) {
  Job job;
  job.schema.lattice = {
      {0.042, 0.084, 0.022}, {0, 0, 0}, {Coord(-30, -16, -54), Coord(30, 16, 54)}};
  const double band = job.schema.lattice.diagonalMm();
  auto surface = openvdb::FloatGrid::create(static_cast<float>(band));
  surface->setGridClass(openvdb::GRID_LEVEL_SET);
  for (auto at = job.schema.lattice.box.begin(); at; ++at) {
    const double d = job.schema.lattice.position(*at).length() - 1;
    if (std::abs(d) <= band) {
      surface->tree().setValue(*at, static_cast<float>(d));
    } else if (d < 0) {
      surface->tree().setValueOff(*at, static_cast<float>(-band));
    }
  }
  job.schema.grids["surface"] = surface->copyGridWithNewTree();
  job.grids["surface"] = surface;
  const json whole = json::parse(told(job, {"--json"}, 112));
  EXPECT_NEAR(whole["surface"]["area_mm2"].get<double>() / (4 * std::numbers::pi), 1, 2e-3);
  EXPECT_EQ(json::parse(told(job, {"--json"}, 8)), whole);
}

TEST(Stats, AHistogramCountsActiveValues) {
  auto values = openvdb::Int32Grid::create(0);
  values->tree().addTile(1, Coord(0), 3, true);
  values->tree().setValue(Coord(9, 0, 0), 5);
  const json stats = json::parse(told(jobOf({{"closest", values}}, {Coord(0), Coord(15)}),
                                      {"--json", "--histogram", "closest"}));
  EXPECT_EQ(stats["histogram"]["bins"], json::parse(R"([{"from": 3.0, "to": 4.0, "voxels": 512},
                            {"from": 4.0, "to": 5.0, "voxels": 0},
                            {"from": 5.0, "to": 6.0, "voxels": 1}])"));
}

TEST(Stats, TellsItInWordsToo) {
  const auto material = test::drawnMaterial({{"17"}});
  EXPECT_EQ(told(jobOf({{"material", material}}, {Coord(0), Coord(1, 0, 0)}),
                 {"--histogram", "material", "--bins", "2"}),
            "                           voxels           ml    faces mm2\n"
            "white                           1      0.00025         2.75\n"
            "(not in the table)              1      0.00025         2.75\n"
            "material from, to, voxels\n"
            "           0            4              1 ########################################\n"
            "           4            8              1 ########################################\n");
}

TEST(Stats, RefusesWhatItCannotMeasure) {
  const auto planned = [](Grids grids, const std::vector<std::string>& arguments) {
    return [grids = std::move(grids), arguments] {
      told(jobOf(grids, {Coord(0), Coord(1)}), arguments);
    };
  };
  const auto normals = openvdb::Vec3SGrid::create();
  EXPECT_THAT(planned({{"N", normals}}, {}),
              ThrowsMessage<UsageError>(
                  "there is no grid 'material', 'solid' or 'surface' to measure; --histogram GRID "
                  "counts the values of another"));
  EXPECT_THAT(planned({{"N", normals}}, {"--histogram", "N"}),
              ThrowsMessage<UsageError>("--histogram: grid 'N' is of vec3s, not of numbers"));
  EXPECT_THAT(planned({{"N", normals}}, {"--histogram", "M"}),
              ThrowsMessage<DataError>(HasSubstr("no grid 'M'; there is 'N'")));
  EXPECT_THAT(planned({{"surface", openvdb::FloatGrid::create()}}, {}),
              ThrowsMessage<DataError>("grid 'surface' is no level set: it holds no distances"));
}

}  // namespace
}  // namespace vdbdither
