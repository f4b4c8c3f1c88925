#include <cmath>
#include <cstdint>
#include <draco/compression/encode.h>
#include <draco/mesh/mesh.h>
#include <memory>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "io/image/srgb.h"
#include "io/mesh/mesh_reader.h"
#include "io/mesh/mesh_writer.h"
#include "tests/support/parsed_meshes.h"
#include "tests/support/scratch_folder.h"
#include "tests/support/shapes.h"

namespace vdbdither::test {
namespace {

using openvdb::Vec3d;
using openvdb::Vec4f;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

const std::string remedy = "; export or download it again";

template <class Value>
std::unique_ptr<draco::PointAttribute> attribute(draco::GeometryAttribute::Type type,
                                                 draco::DataType data_type, int components,
                                                 const std::vector<Value>& values) {
  auto result = std::make_unique<draco::PointAttribute>();
  result->Init(type, static_cast<std::int8_t>(components), data_type, false,
               values.size() / static_cast<std::size_t>(components));
  result->buffer()->Write(0, values.data(), values.size() * sizeof(Value));
  return result;
}

std::unique_ptr<draco::Mesh> dracoMesh(const Mesh& mesh) {
  auto result = std::make_unique<draco::Mesh>();
  result->set_num_points(static_cast<std::uint32_t>(mesh.vertices.size()));
  std::vector<float> positions;
  for (const Vec3d& vertex : mesh.vertices) {
    for (int axis = 0; axis < 3; ++axis) positions.push_back(static_cast<float>(vertex[axis]));
  }
  result->AddAttribute(
      attribute(draco::GeometryAttribute::POSITION, draco::DT_FLOAT32, 3, positions));
  for (const auto& [a, b, c] : mesh.triangles)
    result->AddFace({draco::PointIndex(a), draco::PointIndex(b), draco::PointIndex(c)});
  return result;
}

std::string encoded(const draco::Mesh& mesh, int method, int bits = 14) {
  draco::Encoder encoder;
  encoder.SetEncodingMethod(method);
  encoder.SetAttributeQuantization(draco::GeometryAttribute::POSITION, bits);
  draco::EncoderBuffer buffer;
  EXPECT_TRUE(encoder.EncodeMeshToBuffer(mesh, &buffer).ok());
  return {buffer.data(), buffer.size()};
}

TEST(Draco, ReadsBothMethods) {
  const Mesh sphere = sphereMesh({1, 2, 3}, 10, 12);
  for (const int method : {draco::MESH_SEQUENTIAL_ENCODING, draco::MESH_EDGEBREAKER_ENCODING}) {
    const Mesh mesh = parseQuietly(encoded(*dracoMesh(sphere), method));
    EXPECT_THAT(mesh.vertices, SizeIs(sphere.vertices.size()));
    EXPECT_THAT(mesh.triangles, SizeIs(sphere.triangles.size()));
    for (const Vec3d& vertex : mesh.vertices)
      EXPECT_NEAR((vertex - Vec3d(1, 2, 3)).length(), 10, 0.003);
  }
}

TEST(Draco, PointsAtSeamsOfOtherAttributesShareTheirVertex) {
  const Mesh box = boxMesh({0, 0, 0}, {1, 2, 3});
  const auto mesh = dracoMesh(box);
  // Each corner has a colour of its own.
  draco::IndexTypeVector<draco::CornerIndex, draco::AttributeValueIndex> corners;
  std::vector<std::uint8_t> colours;
  for (std::uint32_t i = 0; i < 36; ++i) {
    corners.push_back(draco::AttributeValueIndex(i));
    for (int c = 0; c < 3; ++c) colours.push_back(static_cast<std::uint8_t>(i));
  }
  mesh->AddAttributeWithConnectivity(
      attribute(draco::GeometryAttribute::COLOR, draco::DT_UINT8, 3, colours), corners);
  ASSERT_GT(mesh->num_points(), 8U);
  const Mesh read = parseQuietly(encoded(*mesh, draco::MESH_EDGEBREAKER_ENCODING));
  EXPECT_THAT(read.vertices, SizeIs(8));
  EXPECT_THAT(read.triangles, SizeIs(12));
}

template <class Value>
Vec4f firstColour(draco::DataType type, int components, const std::vector<Value>& value) {
  const auto mesh = dracoMesh({{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 2}}});
  std::vector<Value> values;
  for (int i = 0; i < 3; ++i) values.insert(values.end(), value.begin(), value.end());
  mesh->AddAttribute(attribute(draco::GeometryAttribute::COLOR, type, components, values));
  const std::string bytes = encoded(*mesh, draco::MESH_SEQUENTIAL_ENCODING);
  EXPECT_EQ(parseQuietly(bytes).appearance, nullptr) << "nobody asked for it";
  const Mesh read = parseMesh(MeshFile("part", bytes, {}, MeshColours::read));
  return read.appearance->colours.at(0)[2];
}

TEST(Draco, ReadsColoursOfVertices) {
  const auto linear = [](double encoded) { return static_cast<float>(linearOfSrgb(encoded)); };
  EXPECT_EQ(firstColour<std::uint8_t>(draco::DT_UINT8, 3, {255, 128, 0}),
            Vec4f(1, linear(128 / 255.0), 0, 1));
  EXPECT_EQ(firstColour<std::uint8_t>(draco::DT_UINT8, 4, {0, 255, 0, 51}), Vec4f(0, 1, 0, 0.2F));
  EXPECT_EQ(firstColour<std::uint8_t>(draco::DT_UINT8, 1, {128}),
            Vec4f(linear(128 / 255.0), linear(128 / 255.0), linear(128 / 255.0), 1));
  EXPECT_EQ(firstColour<float>(draco::DT_FLOAT32, 3, {0.5F, 2, std::nanf("")}),
            Vec4f(linear(0.5), 1, 0, 1));
}

TEST(Draco, ReadsTextureCoordinatesFromTheTop) {
  const auto mesh = dracoMesh({{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 2}}});
  mesh->AddAttribute(attribute<float>(draco::GeometryAttribute::TEX_COORD, draco::DT_FLOAT32, 2,
                                      {0, 0, 1, 0.25F, std::nanf(""), 1}));
  const std::string bytes = encoded(*mesh, draco::MESH_SEQUENTIAL_ENCODING);
  const Mesh read = parseMesh(MeshFile("part", bytes, {}, MeshColours::read));
  EXPECT_EQ(read.appearance->coordinates.at(0),
            (Appearance::Coordinates{openvdb::Vec2f(0, 1), {1, 0.75F}, {0, 0}}));
}

TEST(Draco, CarriesColoursThroughAFile) {
  const ScratchFolder scratch;
  const Mesh box = boxMesh({0, 0, 0}, {1, 1, 1});
  std::vector<std::array<std::uint8_t, 3>> colours(8);
  for (std::size_t i = 0; i < 8; ++i) colours[i] = {static_cast<std::uint8_t>(i * 30), 1, 255};
  const std::vector<float> qualities(8, 0.5F);
  for (const char* name : {"a.drc", "a.glb"}) {
    MeshWriter writer(scratch / name, MeshEncoding{{true, true, "as it was \"measured\""}, {}});
    writer.add(box.vertices, box.triangles, 0, colours, qualities);
    writer.commit();
    const Mesh mesh = readMesh(scratch / name, {}, MeshColours::read);
    expectSame(mesh, box);
    ASSERT_NE(mesh.appearance, nullptr);
    for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
      for (std::size_t corner = 0; corner < 3; ++corner) {
        for (int c = 0; c < 3; ++c) {
          EXPECT_NEAR(
              mesh.appearance->colours[t][corner][c],
              linearOfSrgb(colours[box.triangles[t][corner]][static_cast<std::size_t>(c)] / 255.0),
              1e-5)
              << name;
        }
      }
    }
  }
}

TEST(Draco, RefusesPointClouds) {
  std::string bytes =
      encoded(*dracoMesh(boxMesh({0, 0, 0}, {1, 1, 1})), draco::MESH_SEQUENTIAL_ENCODING);
  bytes[7] = 0;
  EXPECT_EQ(refusal(bytes), "'part': the Draco data are a point cloud, without triangles" + remedy);
}

TEST(Draco, RefusesCountsThatDoNotFitTheSizeBeforeMemoryIsTaken) {
  const auto varint = [](std::uint32_t value) {
    std::string bytes;
    for (; value > 127; value >>= 7) bytes.push_back(static_cast<char>((value & 127) | 128));
    bytes.push_back(static_cast<char>(value));
    return bytes;
  };
  const std::string header("DRACO\2\2\1\1\0\0", 11);
  const std::string traversal(1, '\0');
  const auto claim = [&](std::uint32_t triangles, int seams) {
    return header + traversal + varint(triangles) + varint(triangles) +
           std::string(1, static_cast<char>(seams)) + varint(triangles) + varint(0);
  };
  EXPECT_THAT(refusal(claim(1'000'000'000, 0)),
              HasSubstr("the Draco data claim 122070 MiB, too much"));
  EXPECT_THAT(refusal(claim(1'000'000, 255)), HasSubstr("MiB, too much for their size"));
  EXPECT_THAT(refusal(claim(3, 0)), HasSubstr("are cut off, damaged, or of a newer version"));
  EXPECT_THAT(refusal(header), HasSubstr("are cut off"));
  EXPECT_THAT(refusal("DRACO\2\2"), HasSubstr("have no Draco header"));
}

TEST(Draco, RefusesPositionsThatAreNotFinite) {
  const auto mesh = dracoMesh({{{0, 0, 0}, {INFINITY, 0, 0}, {0, 1, 0}}, {{0, 1, 2}}});
  EXPECT_EQ(refusal(encoded(*mesh, draco::MESH_SEQUENTIAL_ENCODING, 0)),
            "'part': vertex 2 is not finite (inf 0 0); repair the mesh");
}

TEST(Draco, RefusesTrianglesWithWildPoints) {
  const auto mesh = dracoMesh({{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 2}}});
  mesh->SetFace(draco::FaceIndex(0),
                {draco::PointIndex(0), draco::PointIndex(1), draco::PointIndex(9)});
  EXPECT_EQ(refusal(encoded(*mesh, draco::MESH_SEQUENTIAL_ENCODING)),
            "'part': the Draco data have a triangle with point 9 of 3" + remedy);
}

TEST(Draco, ASpoiltFileIsReadOrRefused) {
  const auto mesh = dracoMesh(sphereMesh({0, 0, 0}, 1, 4));
  for (const int method : {draco::MESH_SEQUENTIAL_ENCODING, draco::MESH_EDGEBREAKER_ENCODING}) {
    const std::string bytes = encoded(*mesh, method);
    expectSpoiltBytesAreReadOrRefused(bytes);
    expectEveryPrefixIsReadOrRefused(bytes, true);
  }
}

}  // namespace
}  // namespace vdbdither::test
