#include <algorithm>
#include <filesystem>
#include <fstream>
#include <map>
#include <regex>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "io/mesh/mesh_writer.h"
#include "tests/support/mesh_files.h"
#include "tests/support/shapes.h"
#include "tests/support/told.h"
#include "vdbdither/engine/operator.h"
#include "vdbdither/model/errors.h"
#include "vdbdither/model/openvdb.h"

namespace vdbdither {

extern const OperatorInfo mesh2sdf;

namespace {

using openvdb::Coord;
using openvdb::CoordBBox;
using openvdb::Vec3d;
using testing::HasSubstr;

void writeObj(const std::filesystem::path& path, const Mesh& mesh) {
  std::ofstream(path) << test::objText(mesh);
}

class Mesh2Sdf : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = std::filesystem::path(testing::TempDir()) /
              testing::UnitTest::GetInstance()->current_test_info()->name();
    std::filesystem::create_directories(folder_);
    path_ = (folder_ / "part.obj").string();
    writeObj(path_, test::boxMesh({1, 2, 3}, {2, 2.5, 3.25}));
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  Schema plan(std::vector<std::string> arguments) {
    operator_ = mesh2sdf.make();
    operator_->setReporter(&listener_);
    Options options;
    operator_->declare(options);
    arguments.insert(arguments.begin(), path_);
    options.parse(arguments);
    return source().plan();
  }
  Source& source() { return dynamic_cast<Source&>(*operator_); }

  float distanceAt(const Schema& schema, const Coord& ijk) {
    const Grids grids = source().run(schema.lattice.layers());
    return openvdb::gridConstPtrCast<openvdb::FloatGrid>(grids.at("surface"))->tree().getValue(ijk);
  }

  template <class Failure>
  std::string refusal(const std::vector<std::string>& arguments) {
    try {
      plan(arguments);
    } catch (const Failure& failure) {
      return failure.what();
    }
    return "accepted";
  }

  std::filesystem::path folder_;
  std::string path_;
  std::unique_ptr<Operator> operator_;
  test::Listener listener_;
};

TEST_F(Mesh2Sdf, KeepsThePositionOfTheMesh) {
  const Schema schema = plan({"--pitch",
                              "50um"
                              ",50um,0.025"});
  EXPECT_EQ(schema.lattice.pitch_mm, Vec3d(0.05, 0.05, 0.025));
  EXPECT_NEAR(distanceAt(schema, Coord(30, 45, 130)), 0, 1e-6);
  EXPECT_NEAR(distanceAt(schema, Coord(30, 45, 131)), 0.025, 1e-6);
  EXPECT_NEAR(distanceAt(schema, Coord(30, 45, 129)), -0.025, 1e-6);
}

TEST_F(Mesh2Sdf, TheBoxHoldsTheMeshAndAVoxelDiagonalAround) {
  const Schema schema = plan({"--pitch", "0.1,0.1,0.05"});
  EXPECT_EQ(schema.lattice.box, CoordBBox(Coord(8, 18, 57), Coord(22, 27, 68)));
}

TEST_F(Mesh2Sdf, PlacesTheMeshOnTheBed) {
  const Schema schema = plan({"--pitch", "0.1,0.1,0.06", "--place"});
  EXPECT_EQ(schema.lattice.box, CoordBBox(Coord(-3, -3, -4), Coord(12, 7, 7)));
  EXPECT_NEAR(distanceAt(schema, Coord(5, 2, 0)), -0.03, 1e-6);
  EXPECT_NEAR(distanceAt(schema, Coord(5, 2, -1)), 0.03, 1e-6);
}

TEST_F(Mesh2Sdf, ScalesByUnitFactorAndFit) {
  EXPECT_EQ(plan({"--pitch", "0.1,0.1,0.1", "--unit", "cm", "--place"}).lattice.box.max().x(), 102);
  EXPECT_EQ(plan({"--pitch", "0.1,0.1,0.1", "--scale", "3", "--place"}).lattice.box.max().x(), 32);
  EXPECT_EQ(plan({"--pitch", "0.1,0.1,0.1", "--fit", "4mm", "--place"}).lattice.box.max().x(), 42);
}

TEST_F(Mesh2Sdf, AUnitIsForFilesThatStateNone) {
  path_ = (folder_ / "part.glb").string();
  const Mesh box = test::boxMesh({0, 0, 0}, {1, 1, 1});
  MeshWriter writer(path_);
  writer.add(box.vertices, box.triangles, 0);
  writer.commit();
  const auto width = [&](const std::vector<std::string>& more) {
    std::vector<std::string> arguments{"--pitch", "0.1,0.1,0.1"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return plan(arguments).lattice.box.dim().x();
  };
  EXPECT_EQ(
      refusal<UsageError>({"--pitch", "0.1,0.1,0.1", "--unit", "m"}),
      "--unit: '" + path_ + "' states the unit of its numbers; leave it out, or give --scale");
  EXPECT_EQ(width({"--unit", "mm"}), width({}));
  EXPECT_EQ(width({"--unit", "m", "--fit", "1mm"}), width({}));
  EXPECT_GT(width({"--scale", "2"}), width({}));
}

TEST_F(Mesh2Sdf, ForeseesTheLeavesOfBandsOfAnyWidth) {
  writeObj(path_, test::sphereMesh({0, 0, 0}, 2, 24));
  for (const char* band : {"0.2mm", "0.8mm", "1.9mm", "6mm"}) {
    const Schema schema = plan({"--pitch", "0.05,0.05,0.05", "--band", band});
    const auto surface = openvdb::gridConstPtrCast<openvdb::FloatGrid>(
        source().run(schema.lattice.layers()).at("surface"));
    std::map<int, double> rows;
    for (auto leaf = surface->tree().cbeginLeaf(); leaf; ++leaf) ++rows[leaf->origin().z()];
    const double fullest = std::max_element(rows.begin(), rows.end(), [](auto& a, auto& b) {
                             return a.second < b.second;
                           })->second;
    const auto leaves = static_cast<double>(surface->tree().leafCount());
    EXPECT_GT(schema.footprint.total, 0.8 * leaves) << band;
    EXPECT_LT(schema.footprint.total, 1.7 * leaves) << band;
    EXPECT_GT(schema.footprint.fullest_row, 0.7 * fullest) << band;
    EXPECT_LT(schema.footprint.fullest_row, 2 * fullest) << band;
  }
}

TEST_F(Mesh2Sdf, TurnsAboutXThenYThenZ) {
  // The long axis goes from x by y to −z, and stays there.
  const Schema schema = plan({"--pitch", "0.1,0.1,0.1", "--rotate", "0,90,0", "--place"});
  EXPECT_EQ(schema.lattice.box.max(), Coord(4, 7, 12));
}

TEST_F(Mesh2Sdf, RefinedCentresLieAQuarterVoxelBesideThePlainOnes) {
  const Schema plain = plan({"--pitch", "0.1,0.1,0.05"});
  const Schema fine = plan({"--pitch", "0.1,0.1,0.05", "--refine-y", "2"});
  EXPECT_EQ(fine.lattice.box.min().y(), 2 * plain.lattice.box.min().y());
  EXPECT_EQ(fine.lattice.box.max().y(), 2 * plain.lattice.box.max().y() + 1);
  for (const int j : {-3, 0, 20}) {
    EXPECT_DOUBLE_EQ(fine.lattice.position({0, 2 * j, 0}).y(), 0.1 * j - 0.025);
    EXPECT_DOUBLE_EQ(fine.lattice.position({0, 2 * j + 1, 0}).y(), 0.1 * j + 0.025);
  }
  EXPECT_NEAR(distanceAt(fine, Coord(15, 40, 62)), 0.025, 1e-6);
}

TEST_F(Mesh2Sdf, AddsNormalsAndNearestTrianglesOnDemand) {
  EXPECT_EQ(plan({"--pitch", "0.1,0.1,0.05"}).grids.size(), 1U);
  const Schema schema = plan({"--pitch", "0.1,0.1,0.05", "--normals", "--closest"});
  const Grids grids = source().run(schema.lattice.layers());
  EXPECT_EQ(grids.size(), 3U);
  for (const auto& [name, grid] : grids) {
    EXPECT_EQ(grid->getName(), name);
    EXPECT_EQ(grid->activeVoxelCount(), grids.at("surface")->activeVoxelCount());
    EXPECT_EQ(schema.grids.at(name)->type(), grid->type());
  }
}

TEST_F(Mesh2Sdf, CarriesThePrinterProfile) {
  std::ofstream(folder_ / "mine.json")
      << R"({"name":"mine","title":"Mine","source":"here","pitch_mm":["0.1","0.1","0.05"],)"
      << R"("build_mm":[0,0,0],"materials":[]})";
  const Schema schema = plan({"--printer", (folder_ / "mine.json").string()});
  EXPECT_EQ(schema.lattice.pitch_mm, Vec3d(0.1, 0.1, 0.05));
  EXPECT_THAT(schema.metadata.at("vdbdither:printer"), HasSubstr("mine"));
}

TEST_F(Mesh2Sdf, RepairsOpenMeshesUnlessStrict) {
  Mesh open = test::boxMesh({1, 2, 3}, {2, 2.5, 3.25});
  open.triangles.pop_back();
  writeObj(path_, open);
  const Schema schema = plan({"--pitch", "0.1,0.1,0.05"});
  EXPECT_LT(distanceAt(schema, Coord(15, 22, 62)), 0);
  EXPECT_EQ(refusal<DataError>({"--pitch", "0.1,0.1,0.05", "--strict"}),
            "the mesh needs repair, which --strict forbids: 3 boundary edges and more");
}

/// The triangles of a box, each a little smaller and by itself.
Mesh looseBox() {
  const Mesh box = test::boxMesh({1, 2, 3}, {2, 2.5, 3.25});
  Mesh loose;
  for (const Mesh::Triangle& t : box.triangles) {
    const Vec3d middle = (box.vertices[t[0]] + box.vertices[t[1]] + box.vertices[t[2]]) / 3;
    const auto first = static_cast<std::uint32_t>(loose.vertices.size());
    for (const std::uint32_t v : t)
      loose.vertices.push_back(box.vertices[v] + 0.01 * (middle - box.vertices[v]));
    loose.triangles.push_back({first, first + 1, first + 2});
  }
  return loose;
}

TEST_F(Mesh2Sdf, GuessesThePartOfLooseTrianglesAndSaysSo) {
  writeObj(path_, looseBox());
  const Schema schema = plan({"--pitch", "0.1,0.1,0.05"});
  EXPECT_THAT(listener_.warnings,
              testing::ElementsAre(testing::MatchesRegex(
                  "the triangles enclose nothing, 36 of their 36 sides meet no other: the part is "
                  "guessed, as where their winding number is above one half, on cells down to "
                  "[0-9.]+ um")));
  EXPECT_EQ(listener_.counts.at("loose_triangles"), 12);
  EXPECT_EQ(listener_.counts.at("boundary_edges"), 36);
  EXPECT_GT(listener_.counts.at("winding_cell_mm"), 0);
  EXPECT_LT(distanceAt(schema, Coord(15, 22, 62)), 0);
  EXPECT_NEAR(distanceAt(schema, Coord(15, 22, 65)), 0, 0.01);
  EXPECT_GT(distanceAt(schema, Coord(15, 22, 66)), 0);
}

TEST_F(Mesh2Sdf, RefusesLooseTrianglesWhereItMayNotGuess) {
  writeObj(path_, looseBox());
  EXPECT_EQ(refusal<DataError>({"--pitch", "0.1,0.1,0.05", "--strict"}),
            "the mesh needs repair, which --strict forbids: the triangles enclose nothing, 36 of "
            "their 36 sides meet no other");
  EXPECT_EQ(refusal<DataError>({"--pitch", "0.1,0.1,0.05", "--closest"}),
            "the triangles enclose nothing, 36 of their 36 sides meet no other: the part is "
            "guessed, and no point of its surface has a triangle for --closest to name; leave it "
            "out");
}

TEST_F(Mesh2Sdf, RefusesWhatCannotBoundAVolumeByTheNameOfItsFile) {
  const std::string solid = path_ + ".solid.obj";
  writeObj(solid, test::boxMesh({0, 0, 0}, {1, 1, 1}));
  Mesh flat = test::boxMesh({1, 2, 3}, {2, 2.5, 3.25});
  const std::string remedy = "; give the surface a thickness in a mesh editor first";
  flat.triangles.resize(2);
  writeObj(path_, flat);
  EXPECT_EQ(refusal<DataError>({"--pitch", "0.1,0.1,0.05"}),
            "'" + path_ +
                "': bounds no volume: it has only 2 triangles with an area, and 4 are needed" +
                remedy);
  flat.triangles.insert(flat.triangles.end(), flat.triangles.begin(), flat.triangles.end());
  writeObj(path_, flat);
  EXPECT_EQ(refusal<DataError>({solid, "--pitch", "0.1,0.1,0.05"}),
            "'" + path_ + "': bounds no volume: all its corners lie in one plane" + remedy);
}

TEST_F(Mesh2Sdf, GuessesOnlyThoseOfSeveralFilesThatAreLoose) {
  const std::string beside = (folder_ / "beside.obj").string();
  writeObj(beside, test::transformed(looseBox(), {0, 0, 0}, {2, 0, 0}));
  const Schema schema = plan({beside, "--pitch", "0.1,0.1,0.05"});
  // Where a guess passes through itself more may be told.
  EXPECT_EQ(std::count_if(listener_.warnings.begin(), listener_.warnings.end(),
                          [](const std::string& warning) {
                            return warning.find("the part is guessed") != std::string::npos;
                          }),
            1);
  const Grids grids = source().run(schema.lattice.layers());
  const auto part = openvdb::gridConstPtrCast<openvdb::Int32Grid>(grids.at("part"));
  const auto surface = openvdb::gridConstPtrCast<openvdb::FloatGrid>(grids.at("surface"));
  EXPECT_LT(surface->tree().getValue(Coord(15, 22, 62)), 0);
  EXPECT_LT(surface->tree().getValue(Coord(35, 22, 62)), 0);
  EXPECT_NE(part->tree().getValue(Coord(15, 22, 64)), part->tree().getValue(Coord(35, 22, 64)));
}

TEST_F(Mesh2Sdf, ClosedSolidsOfOneFileAreParts) {
  const Mesh right = test::boxMesh({4, 2, 3}, {5, 2.5, 3.25});
  std::ofstream(path_) << test::asciiStl(test::boxMesh({1, 2, 3}, {2, 2.5, 3.25}))
                       << std::regex_replace(test::asciiStl(right), std::regex("solid part"),
                                             "solid right");
  const Schema schema = plan({"--pitch", "0.1,0.1,0.05"});
  const Grids grids = source().run(schema.lattice.layers());
  const auto part = openvdb::gridConstPtrCast<openvdb::Int32Grid>(grids.at("part"));
  EXPECT_EQ(part->tree().getValue(Coord(15, 22, 62)), 1);
  EXPECT_EQ(part->tree().getValue(Coord(45, 22, 62)), 2);
}

TEST_F(Mesh2Sdf, RefusesWhatItCannotMean) {
  EXPECT_EQ(refusal<UsageError>({}),
            "give either --printer NAME (vdbdither printers lists them) or --pitch DX,DY,DZ");
  for (const char* pitch : {"1,2", "1,2,0", "1,2,11", "0.9um"}) {
    EXPECT_EQ(refusal<UsageError>({"--pitch", pitch}),
              "--pitch: '" + std::string(pitch) +
                  "' is not accepted; the value must be one length or three, separated by commas, "
                  "each from 0.001 mm to 10 mm");
  }
  for (const char* band : {"0", "1001", "0.5.5", "."}) {
    EXPECT_EQ(refusal<UsageError>({"--pitch", "0.1", "--band", band}),
              "--band: '" + std::string(band) +
                  "' is not accepted; the value must be a number greater than 0, up to 1000, or a "
                  "length");
  }
  for (const char* band : {"-1", "0mm", "2m"}) {
    EXPECT_EQ(refusal<UsageError>({"--pitch", "0.1", "--band", band}),
              "--band: '" + std::string(band) +
                  "' is not accepted; the length must be greater than 0 mm, up to 1000 mm");
  }
  EXPECT_THAT(refusal<DataError>({"--pitch", "1um,1um,1um", "--unit", "m", "--scale", "1000"}),
              HasSubstr("more voxels than can be counted; check --unit and --scale"));
}

}  // namespace
}  // namespace vdbdither
