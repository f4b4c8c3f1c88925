#include "io/mesh/draco_encoding.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "io/image/srgb.h"
#include "io/mesh/mesh_reader.h"
#include "io/mesh/mesh_writer.h"
#include "tests/support/mesh_checks.h"
#include "tests/support/parsed_meshes.h"
#include "tests/support/scratch_folder.h"
#include "tests/support/shapes.h"
#include "vdbdither/model/errors.h"

namespace vdbdither::test {
namespace {

using openvdb::Vec3d;
using testing::HasSubstr;
using testing::ThrowsMessage;
using Rgb = std::array<std::uint8_t, 3>;

class DracoFiles : public testing::TestWithParam<const char*> {
 protected:
  std::filesystem::path write(const Mesh& mesh, std::optional<double> draco_mm,
                              const std::vector<Rgb>& colours = {}) {
    const std::filesystem::path path =
        scratch / (std::to_string(count_++) + std::string(GetParam()));
    MeshWriter writer(path, MeshEncoding{{!colours.empty(), false, ""}, draco_mm});
    writer.add(mesh.vertices, mesh.triangles, 0, colours);
    writer.commit();
    return path;
  }

  ScratchFolder scratch;

 private:
  int count_ = 0;
};

/// Returns the maximum difference of a coordinate between a vertex of `mesh` and the nearest one of
/// `other`.
double farthest(const Mesh& mesh, const Mesh& other) {
  double most = 0;
  for (const Vec3d& vertex : mesh.vertices) {
    double nearest = 1e9;
    for (const Vec3d& there : other.vertices) {
      const Vec3d apart = vertex - there;
      nearest = std::min(nearest,
                         std::max({std::abs(apart.x()), std::abs(apart.y()), std::abs(apart.z())}));
    }
    most = std::max(most, nearest);
  }
  return most;
}

TEST_P(DracoFiles, APrecisionOfNothingKeepsAllInItsOrder) {
  const Mesh sphere = sphereMesh({1, -2, 3}, 7, 14);
  Mesh rounded = sphere;
  for (Vec3d& vertex : rounded.vertices) vertex = Vec3d(openvdb::Vec3s(vertex));
  expectSame(readMesh(write(sphere, 0), {}), rounded);
}

TEST_P(DracoFiles, EveryCoordinateIsWithinThePrecision) {
  const Mesh torus = torusMesh({5, -3, 2}, 20, 6, 24);
  for (const double precision_mm : {0.1, 0.01, 0.001, 0.0001}) {
    const Mesh read = readMesh(write(torus, precision_mm), {});
    EXPECT_LE(farthest(torus, read), precision_mm);
    EXPECT_GT(farthest(torus, read), precision_mm / 8) << "more bits than it needs";
    EXPECT_EQ(firstFlaw(read), "");
    EXPECT_EQ(eulerCharacteristic(read), 0);
    EXPECT_NEAR(volumeOf(read), volumeOf(torus), 4000 * precision_mm);
  }
}

TEST_P(DracoFiles, ColoursStayWithTheirVertices) {
  const Mesh box = boxMesh({0, 0, 0}, {1, 2, 3});
  std::vector<Rgb> colours;
  for (const Vec3d& vertex : box.vertices)
    colours.push_back({static_cast<std::uint8_t>(vertex.x() * 200),
                       static_cast<std::uint8_t>(vertex.y() * 100),
                       static_cast<std::uint8_t>(vertex.z() * 50)});
  const Mesh read = readMesh(write(box, 0.01, colours), {}, MeshColours::read);
  ASSERT_NE(read.appearance, nullptr);
  ASSERT_EQ(read.triangles.size(), box.triangles.size());
  for (std::size_t t = 0; t < read.triangles.size(); ++t) {
    for (std::size_t corner = 0; corner < 3; ++corner) {
      const Vec3d& vertex = read.vertices[read.triangles[t][corner]];
      const openvdb::Vec4f& colour = read.appearance->colours[t][corner];
      EXPECT_NEAR(colour.x(), linearOfSrgb(std::round(vertex.x()) * 200 / 255), 1e-5);
      EXPECT_NEAR(colour.y(), linearOfSrgb(std::round(vertex.y()) * 100 / 255), 1e-5);
      EXPECT_NEAR(colour.z(), linearOfSrgb(std::round(vertex.z()) * 50 / 255), 1e-5);
    }
  }
}

TEST_P(DracoFiles, RoundedMeshesAreSmallAndAlwaysTheSame) {
  const Mesh torus = torusMesh({0, 0, 0}, 20, 6, 64);
  const std::filesystem::path rounded = write(torus, 0.001);
  EXPECT_LT(9 * std::filesystem::file_size(rounded), 36 * torus.vertices.size());
  const std::filesystem::path again = write(torus, 0.001);
  const auto files = filesUnder(scratch.path());
  EXPECT_TRUE(files.at(rounded.filename()) == files.at(again.filename()));
}

TEST_P(DracoFiles, RefuseAPrecisionThatFloatsDoNotHave) {
  const Mesh box = boxMesh({0, 0, 0}, {100, 1, 1});
  EXPECT_THAT([&] { write(box, 1e-5); },
              ThrowsMessage<DataError>(
                  "--draco: 0.01 um is too fine for a mesh of 100 mm; give a longer length, or 0, "
                  "which keeps all coordinates exactly"));
  EXPECT_NO_THROW(write(box, 1e-4));
}

INSTANTIATE_TEST_SUITE_P(Written, DracoFiles, testing::Values(".drc", ".glb"),
                         [](const auto& each) { return std::string(each.param + 1); });

}  // namespace
}  // namespace vdbdither::test
