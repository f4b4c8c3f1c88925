#include <cstdint>
#include <draco/compression/encode.h>
#include <draco/mesh/mesh.h>
#include <meshoptimizer.h>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "io/mesh/mesh_reader.h"
#include "tests/support/gltf_file.h"
#include "tests/support/parsed_meshes.h"
#include "vdbdither/model/errors.h"

namespace vdbdither::test {
namespace {

using openvdb::Vec3d;
using openvdb::Vec4f;
using testing::ElementsAre;
using testing::SizeIs;
using Json = GltfFile::Json;

std::string dracoSquare() {
  draco::Mesh mesh;
  mesh.set_num_points(4);
  const std::vector<float> positions{0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0};
  const std::vector<std::uint8_t> colours{255, 0, 0, 0, 51, 0, 0, 0, 255, 255, 255, 255};
  const auto add = [&](draco::GeometryAttribute::Type type, draco::DataType data_type,
                       const void* data, std::size_t bytes) {
    auto attribute = std::make_unique<draco::PointAttribute>();
    attribute->Init(type, 3, data_type, false, 4);
    attribute->buffer()->Write(0, data, bytes);
    mesh.AddAttribute(std::move(attribute));
  };
  add(draco::GeometryAttribute::POSITION, draco::DT_FLOAT32, positions.data(), 48);
  add(draco::GeometryAttribute::COLOR, draco::DT_UINT8, colours.data(), 12);
  const auto face = [](std::uint32_t a, std::uint32_t b, std::uint32_t c) {
    return draco::Mesh::Face{draco::PointIndex(a), draco::PointIndex(b), draco::PointIndex(c)};
  };
  mesh.AddFace(face(0, 1, 2));
  mesh.AddFace(face(2, 1, 3));
  draco::Encoder encoder;
  encoder.SetAttributeQuantization(draco::GeometryAttribute::POSITION, 8);
  draco::EncoderBuffer buffer;
  EXPECT_TRUE(encoder.EncodeMeshToBuffer(mesh, &buffer).ok());
  return {buffer.data(), buffer.size()};
}

GltfFile compressedByDraco() {
  GltfFile file;
  const int view = file.addView(dracoSquare());
  file.json["accessors"] = {
      {{"componentType", GltfFile::float32}, {"type", "VEC3"}, {"count", 4}},
      {{"componentType", GltfFile::uint8}, {"type", "VEC3"}, {"normalized", true}, {"count", 4}},
      {{"componentType", GltfFile::uint16}, {"type", "SCALAR"}, {"count", 6}}};
  file.json["extensionsRequired"] = {"KHR_draco_mesh_compression"};
  file.addMesh({{"attributes", {{"POSITION", 0}, {"COLOR_0", 1}}},
                {"indices", 2},
                {"extensions",
                 {{"KHR_draco_mesh_compression",
                   {{"bufferView", view}, {"attributes", {{"POSITION", 0}, {"COLOR_0", 1}}}}}}}});
  return file;
}

TEST(Gltf, ReadsWhatDracoCompressed) {
  const std::string bytes = compressedByDraco().glb();
  const Mesh mesh = parseMesh(MeshFile(
      "part", bytes, [](const std::string& warning) { ADD_FAILURE() << warning; },
      MeshColours::read));
  ASSERT_THAT(mesh.vertices, SizeIs(4));
  ASSERT_THAT(mesh.triangles, SizeIs(2));
  for (std::size_t t = 0; t < 2; ++t) {
    for (std::size_t corner = 0; corner < 3; ++corner) {
      const Vec3d& at = mesh.vertices[mesh.triangles[t][corner]];
      const Vec4f colour = mesh.appearance->colours[t][corner];
      const Vec4f expected = at.x() + at.y() < 500    ? Vec4f(1, 0, 0, 1)
                             : at.x() + at.y() > 1500 ? Vec4f(1, 1, 1, 1)
                             : at.x() > 500           ? Vec4f(0, 0.2F, 0, 1)
                                                      : Vec4f(0, 0, 1, 1);
      EXPECT_EQ(colour, expected) << at;
    }
  }
}

TEST(Gltf, RefusesDracoThatDoesNotFit) {
  GltfFile file = compressedByDraco();
  Json& extension =
      file.json["meshes"][0]["primitives"][0]["extensions"]["KHR_draco_mesh_compression"];
  const std::string refused =
      "'part': meshes[0].primitives[0].extensions."
      "KHR_draco_mesh_compression is refused: the Draco data ";
  const std::string remedy = "; export the file again";
  extension["attributes"]["POSITION"] = 7;
  EXPECT_EQ(refusal(file.text()), refused + "have no attribute 7" + remedy);
  extension["attributes"]["POSITION"] = 0;
  file.buffer.resize(file.buffer.size() / 2);
  file.json["bufferViews"][0]["byteLength"] = file.buffer.size();
  EXPECT_EQ(refusal(file.text()), refused + "are cut off, damaged, or of a newer version" + remedy);
  file.buffer[0] = 'X';
  EXPECT_EQ(refusal(file.text()), refused + "have no Draco header" + remedy);
}

/// The triangle as EXT_meshopt_compression stores it, with its positions and indices compressed.
GltfFile compressedByMeshopt() {
  GltfFile file;
  const std::vector<float> positions{0, 0, 0, 1, 0, 0, 0, 1, 0};
  const std::vector<unsigned int> indices{0, 1, 2};
  std::vector<unsigned char> bytes(meshopt_encodeVertexBufferBound(3, 12));
  bytes.resize(meshopt_encodeVertexBuffer(bytes.data(), bytes.size(), positions.data(), 3, 12));
  const auto add = [&](const std::string& mode, std::size_t stride) {
    const int view = file.addView({reinterpret_cast<const char*>(bytes.data()), bytes.size()});
    Json& json = file.json["bufferViews"][static_cast<std::size_t>(view)];
    json["extensions"]["EXT_meshopt_compression"] = {{"buffer", 0},
                                                     {"byteOffset", json["byteOffset"]},
                                                     {"byteLength", json["byteLength"]},
                                                     {"byteStride", stride},
                                                     {"mode", mode},
                                                     {"count", 3}};
    json["buffer"] = 9;  // the place of data that are not compressed, which need not exist
    return view;
  };
  const int vertices = add("ATTRIBUTES", 12);
  bytes.resize(meshopt_encodeIndexBufferBound(3, 3));
  bytes.resize(meshopt_encodeIndexBuffer(bytes.data(), bytes.size(), indices.data(), 3));
  const int triangles = add("TRIANGLES", 2);
  bytes.resize(meshopt_encodeIndexSequenceBound(3, 3));
  bytes.resize(meshopt_encodeIndexSequence(bytes.data(), bytes.size(), indices.data(), 3));
  const int sequence = add("INDICES", 4);
  const auto accessor = [&](int view, int type, const char* name) {
    file.json["accessors"].push_back(
        {{"bufferView", view}, {"componentType", type}, {"type", name}, {"count", 3}});
  };
  accessor(vertices, GltfFile::float32, "VEC3");
  accessor(triangles, GltfFile::uint16, "SCALAR");
  accessor(sequence, GltfFile::uint32, "SCALAR");
  file.json["extensionsRequired"] = {"EXT_meshopt_compression"};
  file.addMesh({{"attributes", {{"POSITION", 0}}}, {"indices", 1}});
  return file;
}

TEST(Gltf, ReadsWhatMeshoptimizerCompressed) {
  GltfFile file = compressedByMeshopt();
  // The decoder may turn which corner of a triangle comes first.
  const Mesh mesh = parseQuietly(file.glb());
  EXPECT_THAT(mesh.vertices, ElementsAre(Vec3d(0, 0, 0), Vec3d(1000, 0, 0), Vec3d(0, 1000, 0)));
  EXPECT_THAT(mesh.triangles, SizeIs(1));
  file.json["meshes"][0]["primitives"][0]["indices"] = 2;
  expectSame(parseQuietly(file.glb()), {{{0, 0, 0}, {1000, 0, 0}, {0, 1000, 0}}, {{0, 1, 2}}});
}

TEST(Gltf, AppliesTheFiltersOfMeshoptimizer) {
  GltfFile file = compressedByMeshopt();
  // Each number is a mantissa of 24 bits and an exponent of 8: 1 · 2² and 1 · 2⁰.
  const std::vector<std::uint32_t> numbers{0, 0, 0, 0x02000001, 0, 0, 0, 0x00000001, 0};
  std::vector<unsigned char> bytes(meshopt_encodeVertexBufferBound(3, 12));
  bytes.resize(meshopt_encodeVertexBuffer(bytes.data(), bytes.size(), numbers.data(), 3, 12));
  const int view = file.addView({reinterpret_cast<const char*>(bytes.data()), bytes.size()});
  Json& extension = file.json["bufferViews"][0]["extensions"]["EXT_meshopt_compression"];
  extension["byteOffset"] = file.json["bufferViews"][static_cast<std::size_t>(view)]["byteOffset"];
  extension["byteLength"] = bytes.size();
  extension["filter"] = "EXPONENTIAL";
  EXPECT_EQ(parseQuietly(file.glb()).vertices,
            (std::vector<Vec3d>{{0, 0, 0}, {4000, 0, 0}, {0, 1000, 0}}));
}

}  // namespace
}  // namespace vdbdither::test
