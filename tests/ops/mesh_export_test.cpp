#include <cmath>
#include <memory>
#include <numbers>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "io/mesh/mesh_format.h"
#include "io/mesh/mesh_reader.h"
#include "ops/kernels/mesh/mesh_repair.h"
#include "tests/support/drawn_grids.h"
#include "tests/support/filters.h"
#include "tests/support/mesh_checks.h"
#include "tests/support/mesh_files.h"
#include "tests/support/scratch_folder.h"
#include "tests/support/sinks.h"
#include "vdbdither/model/errors.h"

namespace vdbdither {
namespace {

using openvdb::BoolGrid;
using openvdb::Coord;
using openvdb::CoordBBox;
using openvdb::FloatGrid;
using openvdb::Vec3d;
using testing::HasSubstr;
using testing::ThrowsMessage;

struct Export : test::SinkCalled {
  explicit Export(const std::vector<std::string>& arguments)
      : SinkCalled("mesh-export", arguments) {}
};

/// A ball of 0.6 mm, as distances and as voxels.
Schema ball() {
  const Lattice lattice = test::latticeAround({0.042, 0.084, 0.022}, Vec3d(0.7), 0.1);
  const auto surface = test::sampled(test::sphere({0.01, 0.02, -0.03}, 0.6), lattice, 0.2);
  const auto solid = BoolGrid::create(false);
  solid->setName("solid");
  for (auto ijk = lattice.box.begin(); ijk; ++ijk) {
    if (surface->tree().getValue(*ijk) < 0) solid->tree().setValueOn(*ijk, true);
  }
  solid->tree().prune();
  return test::schemaOf(lattice, {{"surface", surface}, {"solid", solid}});
}

/// Reads a mesh back and expects that nothing has to be repaired.
Mesh readWhole(const std::filesystem::path& path) {
  Mesh mesh = readMesh(path, [](const std::string& warning) { ADD_FAILURE() << warning; });
  EXPECT_EQ(test::firstFlaw(mesh), "");
  MeshRepairs repairs;
  const Mesh same = repaired(derived(mesh), repairs).mesh;
  EXPECT_THAT(repairs.lines(), testing::IsEmpty());
  EXPECT_EQ(same.triangles.size(), mesh.triangles.size());
  return mesh;
}

const double ball_mm3 = 4 * std::numbers::pi / 3 * std::pow(0.6, 3);

TEST(MeshExport, AGridsSurfaceReadsBackWithoutRepairsInEveryFormat) {
  const test::ScratchFolder scratch;
  for (const std::string grid : {"surface", "solid"}) {
    for (const MeshFormat* format : test::writtenMeshFormats()) {
      const std::string path = scratch / (grid + std::string(format->ending));
      Export({path, "--grid", grid}).run(ball());
      const Mesh mesh = readWhole(path);
      EXPECT_EQ(test::eulerCharacteristic(mesh), 2) << path;
      EXPECT_NEAR(test::volumeOf(mesh) / ball_mm3, 1, 0.01) << path;
    }
  }
}

TEST(MeshExport, SlabsChangeNoByte) {
  const test::ScratchFolder scratch;
  for (const std::string name : {"a.stl", "a.obj", "a.ply"}) {
    Export({scratch / name}).run(ball(), 8);
    Export({scratch / ("whole-" + name)}).run(ball(), 1000);
  }
  const auto files = test::filesUnder(scratch.path());
  for (const std::string name : {"a.stl", "a.obj", "a.ply"})
    EXPECT_TRUE(files.at(name) == files.at("whole-" + name)) << name;
}

TEST(MeshExport, DracoRoundsCoordinatesWithinTheLength) {
  const test::ScratchFolder scratch;
  const Schema in = ball();
  for (const char* ending : {".glb", ".drc"}) {
    const std::string path = scratch / ("a" + std::string(ending));
    const std::string rounded = scratch / ("rounded" + std::string(ending));
    Export({path}).run(in, 1000);
    Export({rounded, "--draco", "0.5um"}).run(in, 1000);
    EXPECT_LT(4 * std::filesystem::file_size(rounded), std::filesystem::file_size(path));
    EXPECT_NEAR(test::volumeOf(readWhole(rounded)), test::volumeOf(readWhole(path)),
                4 * std::numbers::pi * 0.36 * 0.0005);
  }
}

TEST(MeshExport, ALevelIsADistance) {
  const test::ScratchFolder scratch;
  Export({scratch / "a.ply", "--grid", "surface", "--level", "50um"}).run(ball());
  EXPECT_NEAR(test::volumeOf(readWhole(scratch / "a.ply")) / ball_mm3, std::pow(0.65 / 0.6, 3),
              0.006);
}

TEST(MeshExport, SmoothingTakesTheStairsAway) {
  const test::ScratchFolder scratch;
  Export({scratch / "a.ply"}).run(ball());
  Export({scratch / "b.ply", "--smooth", "taubin"}).run(ball());
  const auto spread = [](const Mesh& mesh) {
    double sum = 0;
    double squares = 0;
    for (const Vec3d& p : mesh.vertices) {
      const double radius = (p - Vec3d(0.01, 0.02, -0.03)).length();
      sum += radius;
      squares += radius * radius;
    }
    const auto count = static_cast<double>(mesh.vertices.size());
    return std::sqrt(squares / count - sum / count * sum / count);
  };
  const Mesh stairs = readWhole(scratch / "a.ply");
  const Mesh smooth = readWhole(scratch / "b.ply");
  EXPECT_EQ(smooth.triangles, stairs.triangles);
  EXPECT_LT(spread(smooth), 0.6 * spread(stairs));
}

TEST(MeshExport, TakesTheGridThatIsFurthestDownTheChain) {
  const test::ScratchFolder scratch;
  Schema in = ball();
  Export({scratch / "a.ply"}).run(in);
  Export({scratch / "b.ply", "--grid", "solid"}).run(in);
  const auto files = test::filesUnder(scratch.path());
  EXPECT_TRUE(files.at("a.ply") == files.at("b.ply"));
}

TEST(MeshExport, RefusesWhatHasNoSurface) {
  const test::ScratchFolder scratch;
  const std::string path = scratch / "a.stl";
  const auto plan = [&](const std::vector<std::string>& more, const Schema& in) {
    std::vector<std::string> arguments{path};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return [=] { Export(arguments)->plan(in); };
  };
  const Schema in = ball();
  EXPECT_THAT(plan({"--draco", "1um"}, in),
              ThrowsMessage<UsageError>("--draco: '" + path +
                                        "' is not compressed; name a .drc or "
                                        ".glb file, or leave it out"));
  EXPECT_THAT(plan({"--grid", "displaced"}, in),
              ThrowsMessage<DataError>("no grid 'displaced'; there is 'solid' 'surface'"));
  EXPECT_THAT(plan({}, test::schemaOf(in.lattice, {})),
              ThrowsMessage<DataError>(
                  "no grid 'printed', 'solid', 'displaced' or 'surface'; there is none"));
  EXPECT_THAT(plan({"--level", "1"}, in),
              ThrowsMessage<UsageError>("--level: grid 'solid' holds voxels, which have no level"));
  EXPECT_THAT(plan({"--grid", "surface", "--level", "1"}, in),
              ThrowsMessage<UsageError>(HasSubstr("holds distances up to 0.2")));
  const auto normals = openvdb::Vec3SGrid::create();
  normals->setName("N");
  EXPECT_THAT(plan({"--grid", "N"}, test::schemaOf(in.lattice, {{"N", normals}})),
              ThrowsMessage<DataError>(HasSubstr("grid 'N' is of vec3s, which has no surface")));
  EXPECT_THAT([&] { Export({scratch / "a.vdb"})->plan(in); },
              ThrowsMessage<UsageError>(HasSubstr("is no mesh file that is written")));
  const auto nothing = BoolGrid::create(false);
  nothing->setName("solid");
  EXPECT_THAT(
      [&] {
        Export({path}).run(test::schemaOf(in.lattice, {{"solid", nothing}}));
      },
      ThrowsMessage<DataError>("grid 'solid' has no surface: nothing of it is inside"));
  EXPECT_TRUE(test::filesUnder(scratch.path()).empty());
}

}  // namespace
}  // namespace vdbdither
