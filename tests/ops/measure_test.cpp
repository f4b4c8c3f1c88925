#include <cmath>
#include <fstream>
#include <memory>
#include <numbers>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "io/mesh/mesh_reader.h"
#include "ops/kernels/mesh/mesh_placement.h"
#include "ops/kernels/mesh/taubin.h"
#include "tests/support/drawn_grids.h"
#include "tests/support/filters.h"
#include "tests/support/mesh_checks.h"
#include "tests/support/mesh_files.h"
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

struct Measuring : test::SinkCalled {
  explicit Measuring(const std::vector<std::string>& arguments)
      : SinkCalled("measure", arguments) {}
};

struct MeasuringMesh : test::FileToolCalled {
  explicit MeasuringMesh(const std::vector<std::string>& arguments)
      : FileToolCalled("measure", arguments) {}
};

nlohmann::json jsonOf(const std::filesystem::path& path) {
  return nlohmann::json::parse(std::ifstream(path));
}

/// A scratch folder with a part: a box of 2 × 2 × 1 mm.
class Measure : public testing::Test {
 protected:
  void SetUp() override { save(test::boxMesh({0, 0, 0}, {2, 2, 1}), "part.stl"); }

  void save(const Mesh& mesh, const std::string& name) const {
    scratch.write(name, test::binaryStl(mesh));
  }
  [[nodiscard]] std::string file(const std::string& name) const { return scratch / name; }

  test::ScratchFolder scratch;
};

TEST_F(Measure, AMeshOfItsOwnIsMeasuredWithoutAChain) {
  save(test::boxMesh(Vec3d(-0.01), Vec3d(2.01, 2.01, 1.01)), "result.stl");
  const MeasuringMesh measuring({file("result.stl"), "--reference", file("part.stl"), "--margin",
                                 "0.1", "--report", file("report.json"), "--map", file("map.ply")});
  measuring.run();
  const nlohmann::json report = jsonOf(scratch / "report.json");
  EXPECT_NEAR(report["area"]["p50_mm"], 0.01, 1e-6);
  EXPECT_NEAR(report["area"]["bias_mm"], 0.01, 1e-4);
  EXPECT_NEAR(report["vertices"]["mean_mm"], 0.01 * std::sqrt(3.0), 1e-6);
  EXPECT_NEAR(report["volume_error_mm3"], 2.02 * 2.02 * 1.02 - 4, 1e-5);
  EXPECT_NEAR(report["volume_error_percent"], 100 * (2.02 * 2.02 * 1.02 - 4) / 4, 1e-4);
  EXPECT_EQ(report["area"]["cumulative_mm"].size(), 101U);
  EXPECT_EQ(report["facets"].size(), 6U);
  EXPECT_FALSE(report.contains("components")) << "of a mesh nothing is known about voxels";
  EXPECT_FALSE(report["axes"]["z"].contains("staircase_mm"));
  EXPECT_EQ(measuring.said.printed, "") << "the report says it";
  EXPECT_NEAR(measuring.said.counts.at("p50_mm"), 0.01, 1e-6);
  const Mesh map = readMesh(scratch / "map.ply", {});
  EXPECT_EQ(map.triangles.size(), 12U);
}

TEST_F(Measure, WhereShellsOfTheReferenceOverlapTheVolumeCountsOnce) {
  // Two boxes, one half in the other, and a third within them that faces outwards.
  save(joined({test::boxMesh({0, 0, 0}, {2, 2, 1}), test::boxMesh({1, 0.5, 0}, {3, 1.5, 1}),
               test::boxMesh({0.5, 0.5, 0.25}, {1, 1, 0.75})}),
       "overlap.stl");
  save(test::boxMesh({0, 0, 0}, {2, 2, 1}), "result.stl");
  const MeasuringMesh measuring(
      {file("result.stl"), "--reference", file("overlap.stl"), "--report", file("report.json")});
  measuring.run();
  const nlohmann::json report = jsonOf(scratch / "report.json");
  EXPECT_NEAR(report["reference"]["volume_mm3"], 5, 5e-5);
  EXPECT_NEAR(report["volume_error_mm3"], -1, 5e-5);
}

TEST_F(Measure, VoxelsAreMeasuredAsTheyComeWithTheirPiecesAndCavities) {
  const Lattice lattice{{0.1, 0.1, 0.05}, {0, 0, 0}, CoordBBox(Coord(-4), Coord(30))};
  const auto solid = BoolGrid::create(false);
  solid->setName("solid");
  // Voxel centres at 0.05, 0.15, … would make the box exact; at 0, 0.1, … it is half a voxel off.
  solid->tree().sparseFill(CoordBBox(Coord(1, 1, 1), Coord(20, 20, 20)), true);
  solid->tree().setValueOff(Coord(10, 10, 10), false);
  solid->tree().setValueOn(Coord(25, 25, 25), true);
  const Schema schema = test::schemaOf(lattice, {{"solid", solid}});
  const std::vector<std::string> arguments{"--reference", file("part.stl"), "--report"};
  std::vector<std::string> files;
  for (const int height : {8, 16, 1000}) {
    files.push_back(file(std::to_string(height) + ".json"));
    std::vector<std::string> all = arguments;
    all.push_back(files.back());
    Measuring(all).run(schema, height);
  }
  const nlohmann::json report = jsonOf(files[0]);
  EXPECT_EQ(jsonOf(files[1]), report);
  EXPECT_EQ(jsonOf(files[2]), report);
  EXPECT_EQ(report["components"]["count"], 2);
  EXPECT_EQ(report["components"]["largest"], nlohmann::json({7999, 1}));
  EXPECT_EQ(report["cavities"]["count"], 1);
  EXPECT_EQ(report["surface"]["of"], "grid solid");
  // The side at 2 mm is half a voxel outside, at 2.05; that at 0 half a voxel inside.
  EXPECT_NEAR(report["axes"]["x"]["mean_mm"], 0.05, 0.01);
  EXPECT_NEAR(report["axes"]["x"]["bias_mm"], 0, 0.01);
  EXPECT_GT(report["axes"]["x"]["correlation"], 0.3);
  EXPECT_TRUE(report["axes"]["z"].contains("staircase_mm"));
}

TEST_F(Measure, TheReferenceIsPlacedAsThePartWas) {
  save(test::transformed(test::boxMesh({0, 0, 0}, {20, 20, 10}), {10, 0, 30}, {0, 0, 0}),
       "result.stl");
  const MeasuringMesh measuring({file("result.stl"), "--reference", file("part.stl"), "--unit",
                                 "cm", "--rotate", "10,0,30", "--spacing", "0.5", "--report",
                                 file("report.json")});
  measuring.run();
  EXPECT_NEAR(jsonOf(scratch / "report.json")["area"]["max_mm"], 0, 3e-6);
}

TEST_F(Measure, SaysItInWordsOrAsJson) {
  save(test::boxMesh(Vec3d(-0.01), Vec3d(2.01, 2.01, 1.01)), "result.stl");
  const MeasuringMesh words({file("result.stl"), "--reference", file("part.stl")});
  words.run();
  EXPECT_THAT(words.said.printed, HasSubstr("by area"));
  EXPECT_THAT(words.said.printed, HasSubstr("10.000"));
  const MeasuringMesh json({file("result.stl"), "--reference", file("part.stl"), "--json"});
  json.run();
  EXPECT_NEAR(nlohmann::json::parse(json.said.printed)["area"]["p50_mm"], 0.01, 1e-6);
}

TEST_F(Measure, TheMapStatesItsRangeAndColoursByTheSign) {
  save(test::boxMesh(Vec3d(0.01, -0.01, 0), Vec3d(2.01, 2.01, 1)), "result.stl");
  MeasuringMesh({file("result.stl"), "--reference", file("part.stl"), "--map", file("map.ply"),
                 "--map-range", "20um", "--report", file("report.json")})
      .run();
  std::ifstream stream(scratch / "map.ply", std::ios::binary);
  const std::string text((std::istreambuf_iterator<char>(stream)), {});
  EXPECT_THAT(text,
              HasSubstr("comment quality is the error in mm; blue is -0.02, grey 0, red 0.02"));
  EXPECT_EQ(jsonOf(scratch / "report.json")["map_range_mm"], 0.02);
}

TEST_F(Measure, SmoothingComesBeforeMeasuring) {
  save(test::sphereMesh({1, 1, 0.5}, 0.4, 20), "result.stl");
  const std::vector<std::string> arguments{file("result.stl"), "--reference", file("part.stl"),
                                           "--json"};
  const MeasuringMesh plain(arguments);
  plain.run();
  std::vector<std::string> more = arguments;
  more.insert(more.end(), {"--smooth", "taubin", "--iterations", "20"});
  const MeasuringMesh smooth(more);
  smooth.run();
  EXPECT_EQ(nlohmann::json::parse(smooth.said.printed)["surface"]["smoothing"], 20);
  const auto volumeSaid = [](const MeasuringMesh& measuring) {
    return nlohmann::json::parse(measuring.said.printed)["surface"]["volume_mm3"].get<double>();
  };
  Mesh sphere = test::sphereMesh({1, 1, 0.5}, 0.4, 20);
  EXPECT_NEAR(volumeSaid(plain), test::volumeOf(sphere), 1e-6);
  EXPECT_NEAR(volumeSaid(plain), 4 * std::numbers::pi / 3 * 0.4 * 0.4 * 0.4, 0.004);
  vdbdither::smooth(sphere, {0.5, -0.53, 20});
  EXPECT_NEAR(volumeSaid(smooth), test::volumeOf(sphere), 1e-6);
}

TEST_F(Measure, RefusesWhatCannotBeMeasured) {
  const auto plan = [&](const std::vector<std::string>& arguments) {
    return [=] { MeasuringMesh(arguments).run(); };
  };
  EXPECT_THAT(plan({file("part.stl")}),
              ThrowsMessage<UsageError>("'--reference' is missing; see --help"));
  EXPECT_THAT(plan({file("part.stl"), "--reference", file("none.stl")}),
              ThrowsMessage<DataError>(HasSubstr("no such file")));
  EXPECT_THAT(plan({file("part.stl"), "--reference", file("part.stl"), "--map", "map.stl"}),
              ThrowsMessage<UsageError>(HasSubstr(
                  "--map: 'map.stl' cannot hold colours; name a .drc, .glb or .ply file")));
  for (const char* spacing : {"0", "1e-5mm", "2m"}) {
    EXPECT_THAT(plan({file("part.stl"), "--reference", file("part.stl"), "--spacing", spacing}),
                ThrowsMessage<UsageError>("--spacing: '" + std::string(spacing) +
                                          "' is not accepted; the length must be from 0.001 mm to "
                                          "1000 mm"));
  }
  EXPECT_THAT(
      plan({file("part.stl"), "--reference", file("part.stl"), "--report", file("part.stl")}),
      ThrowsMessage<UsageError>(HasSubstr("exists; --overwrite replaces it")));
  EXPECT_THAT(
      [&] {
        Measuring({"--reference", file("part.stl")})->plan({});
      },
      ThrowsMessage<DataError>(HasSubstr("there is none")));
  Mesh open = test::boxMesh({0, 0, 0}, {1, 1, 1});
  open.triangles.pop_back();
  save(open, "open.stl");
  EXPECT_THAT(
      [&] {
        MeasuringMesh({file("open.stl"), "--reference", file("part.stl"), "--smooth", "taubin"})
            .run();
      },
      ThrowsMessage<DataError>(HasSubstr("is no closed mesh")));
  const auto nothing = BoolGrid::create(false);
  nothing->setName("solid");
  const Lattice lattice{{1, 1, 1}, {0, 0, 0}, CoordBBox(Coord(0), Coord(7))};
  EXPECT_THAT(
      [&] {
        Measuring({"--reference", file("part.stl")})
            .run(test::schemaOf(lattice, {{"solid", nothing}}));
      },
      ThrowsMessage<DataError>("grid 'solid' has no surface: nothing of it is inside"));
}

}  // namespace
}  // namespace vdbdither
