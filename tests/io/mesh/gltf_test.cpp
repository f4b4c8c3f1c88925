#include <cmath>
#include <cstdint>
#include <fstream>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "io/mesh/mesh_reader.h"
#include "tests/support/gltf_file.h"
#include "tests/support/parsed_meshes.h"
#include "tests/support/scratch_folder.h"
#include "vdbdither/model/errors.h"

namespace vdbdither::test {
namespace {

using openvdb::Vec2f;
using openvdb::Vec3d;
using openvdb::Vec4f;
using testing::ElementsAre;
using testing::IsEmpty;
using testing::SizeIs;
using Json = GltfFile::Json;

/// What a file with the triangle of `GltfFile::triangle` is read as.
void expectTriangle(const std::string& bytes) {
  expectSame(parseQuietly(bytes), {{{0, 0, 0}, {1000, 0, 0}, {0, 1000, 0}}, {{0, 1, 2}}});
}

/// Of a file with the node of `GltfFile::ofTriangle`.
Mesh withNode(const Json& node) {
  GltfFile file;
  file.addMesh(file.triangle(), node);
  return parseQuietly(file.text());
}

Mesh parseColours(const std::string& bytes, Warnings* warnings = nullptr) {
  Mesh mesh = parseMesh(MeshFile(
      "part", bytes,
      [&](const std::string& warning) {
        if (warnings != nullptr) warnings->push_back(warning);
      },
      MeshColours::read));
  if (mesh.appearance == nullptr) return mesh;
  const Appearance& look = *mesh.appearance;
  EXPECT_EQ(look.material.size(), mesh.triangles.size());
  for (const std::uint32_t material : look.material) EXPECT_LT(material, look.materials.size());
  return mesh;
}

TEST(Gltf, IsReadAsJsonAndAsGlb) {
  const GltfFile file = GltfFile::ofTriangle();
  expectTriangle(file.text());
  expectTriangle("\xEF\xBB\xBF\n " + file.text());
  expectTriangle(file.glb());
}

TEST(Gltf, ReadsBuffersBesideItWithinItsFolder) {
  const ScratchFolder scratch;
  std::filesystem::create_directory(scratch / "a b");
  const auto write = [&](const std::string& name, const std::string& bytes) {
    std::ofstream(scratch / name, std::ios::binary) << bytes;
  };
  GltfFile file = GltfFile::ofTriangle();
  write("a b/ü.bin", file.buffer);
  file.json["buffers"] = {{{"byteLength", 36}, {"uri", "a%20b/%C3%BC.bin"}}};
  write("part.gltf", file.json.dump());
  EXPECT_THAT(readMesh(scratch / "part.gltf", {}).triangles, SizeIs(1));

  const auto refusalOf = [&](const std::string& uri) -> std::string {
    file.json["buffers"][0]["uri"] = uri;
    write("part.gltf", file.json.dump());
    try {
      readMesh(scratch / "part.gltf", {});
    } catch (const DataError& error) {
      return std::string(error.what()).substr(std::string(scratch / "part.gltf").size() + 4);
    }
    return "read";
  };
  write("../outside.bin", file.buffer);
  EXPECT_EQ(refusalOf("../outside.bin"),
            "buffer '../outside.bin' lies outside of the folder of the mesh; move it there");
  std::filesystem::remove(scratch / "../outside.bin");
  const std::string elsewhere =
      " is not a file in the folder of the mesh; put it there and name it "
      "by a relative path";
  EXPECT_EQ(refusalOf("http://a.de/b.bin"), "buffer 'http://a.de/b.bin'" + elsewhere);
  EXPECT_EQ(refusalOf("file:///etc/passwd"), "buffer 'file:///etc/passwd'" + elsewhere);
  EXPECT_EQ(refusalOf("/etc/passwd"),
            "buffer '/etc/passwd': no such file in the folder of the mesh; put it there");
  EXPECT_EQ(refusalOf("%2e%2e%2f%2e%2e%2fetc%2fpasswd"),
            "buffer '../../etc/passwd' lies outside of the folder of the mesh; move it there");
}

TEST(Gltf, NodesMoveTurnAndScale) {
  const double half = std::sqrt(0.5);
  const Mesh turned = withNode(
      {{"translation", {1, 2, 3}}, {"rotation", {0, 0, half, half}}, {"scale", {2, 3, 4}}});
  EXPECT_TRUE(turned.vertices[0].eq(Vec3d(1000, 2000, 3000), 1e-9));
  EXPECT_TRUE(turned.vertices[1].eq(Vec3d(1000, 4000, 3000), 1e-9));
  EXPECT_TRUE(turned.vertices[2].eq(Vec3d(-2000, 2000, 3000), 1e-9));
  // By columns.
  const Mesh matrix = withNode({{"matrix", {0, 2, 0, 0, -3, 0, 0, 0, 0, 0, 4, 0, 1, 2, 3, 1}}});
  EXPECT_EQ(matrix.vertices,
            (std::vector<Vec3d>{{1000, 2000, 3000}, {1000, 4000, 3000}, {-2000, 2000, 3000}}));
}

TEST(Gltf, ChildrenMoveWithTheirParents) {
  GltfFile file = GltfFile::ofTriangle();
  file.json["nodes"].push_back(
      {{"children", {0}}, {"translation", {1, 0, 0}}, {"scale", {2, 2, 2}}});
  file.json["nodes"][0]["translation"] = {0, 1, 0};
  file.json["scenes"][0]["nodes"] = {1};
  EXPECT_EQ(parseQuietly(file.text()).vertices,
            (std::vector<Vec3d>{{1000, 2000, 0}, {3000, 2000, 0}, {1000, 4000, 0}}));
}

TEST(Gltf, AReflectionKeepsTrianglesFacingOutward) {
  const Mesh mesh = withNode({{"scale", {-1, 1, 1}}});
  EXPECT_EQ(mesh.vertices[1], Vec3d(-1000, 0, 0));
  EXPECT_EQ(mesh.triangles[0], (Mesh::Triangle{0, 2, 1}));
  EXPECT_EQ(withNode({{"scale", {-1, -1, 1}}}).triangles[0], (Mesh::Triangle{0, 1, 2}));
}

TEST(Gltf, SeveralNodesHoldTheSameMesh) {
  GltfFile file = GltfFile::ofTriangle();
  file.json["nodes"].push_back({{"mesh", 0}, {"translation", {0, 0, 1}}});
  file.json["scenes"][0]["nodes"] = {1, 0};
  const Mesh mesh = parseQuietly(file.text());
  EXPECT_EQ(mesh.vertices[0], Vec3d(0, 0, 1000));
  EXPECT_EQ(mesh.vertices[3], Vec3d(0, 0, 0));
  EXPECT_THAT(mesh.triangles, ElementsAre(Mesh::Triangle{0, 1, 2}, Mesh::Triangle{3, 4, 5}));
}

TEST(Gltf, PartsAreNamedByNodesAndMeshesAndHaveNamesOfTheirOwn) {
  GltfFile file;
  const Json primitive = file.triangle();
  for (const char* name : {"wheel", "wheel", "", "", "wheel 2", "wheel"})
    file.addMesh(primitive, *name == '\0' ? Json::object() : Json{{"name", name}});
  file.json["meshes"][2]["name"] = "axle";
  file.json["meshes"][0]["name"] = "not this";
  file.json["meshes"][0]["primitives"].push_back(primitive);
  std::vector<std::string> names;
  const Mesh mesh = parseQuietly(file.text());
  for (const MeshPart& part : mesh.parts) names.push_back(part.name);
  EXPECT_THAT(names, ElementsAre("wheel", "wheel 2", "axle", "part 4", "wheel 2 2", "wheel 3"));
  EXPECT_EQ(mesh.parts[1].begin, 2U) << "primitives of a mesh are one part";
  EXPECT_THAT(parseQuietly(GltfFile::ofTriangle().text()).parts, IsEmpty());
}

TEST(Gltf, TakesTheDefaultSceneOrAll) {
  GltfFile file;
  const Json primitive = file.triangle();
  for (double z : {0.0, 1.0, 2.0}) file.addMesh(primitive, {{"translation", {0, 0, z}}});
  const auto heights = [&] {
    std::vector<double> z;
    const Mesh mesh = parseQuietly(file.text());
    for (std::size_t i = 0; i < mesh.vertices.size(); i += 3) z.push_back(mesh.vertices[i].z());
    return z;
  };
  file.json["scenes"] = {{{"nodes", {0}}}, {{"nodes", {2, 1}}}, {{"nodes", {1}}}};
  file.json["scene"] = 1;
  EXPECT_THAT(heights(), ElementsAre(2000, 1000));
  file.json.erase("scene");
  EXPECT_THAT(heights(), ElementsAre(0, 2000, 1000));
  file.json.erase("scenes");
  EXPECT_THAT(heights(), ElementsAre(0, 1000, 2000));
  file.json["nodes"][2]["children"] = {0};
  EXPECT_THAT(heights(), ElementsAre(1000, 2000, 2000)) << "children are no roots";
}

TEST(Gltf, ReadsIndicesOfEveryType) {
  const auto expect = [](auto type, int code) {
    GltfFile file;
    Json primitive = file.triangle();
    primitive["indices"] = file.add<decltype(type)>({2, 1, 0}, code, "SCALAR");
    file.addMesh(primitive);
    EXPECT_THAT(parseQuietly(file.text()).triangles, ElementsAre(Mesh::Triangle{2, 1, 0}));
  };
  expect(std::uint8_t{}, GltfFile::uint8);
  expect(std::uint16_t{}, GltfFile::uint16);
  expect(std::uint32_t{}, GltfFile::uint32);
}

TEST(Gltf, TakesOnlyTheVerticesThatAPrimitiveUses) {
  GltfFile file;
  std::vector<float> positions(3 * 1000, 0.5F);
  positions[3 * 999] = 1;
  const int accessor = file.add(positions, GltfFile::float32, "VEC3");
  file.addMesh({{"attributes", {{"POSITION", accessor}}},
                {"indices", file.add<std::uint16_t>({999, 7, 999}, GltfFile::uint16, "SCALAR")}});
  expectSame(parseQuietly(file.text()), {{{500, 500, 500}, {1000, 500, 500}}, {{1, 0, 1}}});
}

TEST(Gltf, CutsStripsAndFansIntoTriangles) {
  GltfFile file;
  const int positions =
      file.add<float>({0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0, 0, 2, 0}, GltfFile::float32, "VEC3");
  const int indices = file.add<std::uint16_t>({0, 1, 2, 3, 3, 4}, GltfFile::uint16, "SCALAR");
  file.addMesh({{"attributes", {{"POSITION", positions}}}, {"indices", indices}, {"mode", 5}});
  EXPECT_THAT(parseQuietly(file.text()).triangles,
              ElementsAre(Mesh::Triangle{0, 1, 2}, Mesh::Triangle{1, 3, 2}));
  file.json["meshes"][0]["primitives"][0]["mode"] = 6;
  EXPECT_THAT(
      parseQuietly(file.text()).triangles,
      ElementsAre(Mesh::Triangle{0, 1, 2}, Mesh::Triangle{0, 2, 3}, Mesh::Triangle{0, 3, 4}));
}

TEST(Gltf, WarnsOfWhatItPassesOver) {
  GltfFile file = GltfFile::ofTriangle();
  Json points = file.triangle();
  points["mode"] = 0;
  file.addMesh(points);
  file.json["meshes"][0]["primitives"][0]["targets"] = {{{"POSITION", 0}}};
  file.json["nodes"][0]["skin"] = 0;
  Warnings warnings;
  EXPECT_THAT(parse(file.text(), &warnings).triangles, SizeIs(1));
  EXPECT_THAT(warnings,
              ElementsAre("'part': ignored 1 primitives of points or lines",
                          "'part': ignored the morph targets of 1 primitives",
                          "'part': ignored the bones of 1 primitives without weights for them"));
}

/// A triangle that two joints move: one of its corners by halves.
GltfFile withBones() {
  GltfFile file = GltfFile::ofTriangle();
  Json& attributes = file.json["meshes"][0]["primitives"][0]["attributes"];
  attributes["JOINTS_0"] =
      file.add<std::uint8_t>({0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0}, GltfFile::uint8, "VEC4");
  attributes["WEIGHTS_0"] =
      file.add<float>({1, 0, 0, 0, 1, 0, 0, 0, 0.5, 0.5, 0, 0}, GltfFile::float32, "VEC4");
  // Of both joints the node and its bind pose are shifted, one along x and one along z.
  std::vector<float> binds{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, -1, 0, 0, 1,
                           1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0,  0, 0, 1};
  const int matrices = file.add<float>(binds, GltfFile::float32, "MAT4");
  file.json["accessors"][static_cast<std::size_t>(matrices)]["count"] = 2;
  file.json["nodes"][0]["skin"] = 0;
  file.json["nodes"][0]["scale"] = {100, 100, 100};
  file.json["nodes"].push_back({{"translation", {1, 0, 0}}});
  file.json["nodes"].push_back({{"translation", {0, 0, 2}}});
  file.json["scenes"][0]["nodes"].push_back(1);
  file.json["scenes"][0]["nodes"].push_back(2);
  file.json["skins"] = {{{"joints", {1, 2}}, {"inverseBindMatrices", matrices}}};
  return file;
}

TEST(Gltf, BonesPlaceAMeshAndItsNodeDoesNot) {
  EXPECT_THAT(parseQuietly(withBones().text()).vertices,
              ElementsAre(Vec3d(0, 0, 0), Vec3d(1000, 0, 2000), Vec3d(0, 1000, 1000)));
}

TEST(Gltf, RefusesBonesThatThereAreNot) {
  const std::string again = "; export the file again";
  GltfFile file = withBones();
  file.json["skins"][0]["joints"] = {1};
  EXPECT_EQ(refusal(file.text()), "'part': skins[0] has no joint 1, which a vertex names" + again);
  file = withBones();
  file.json["skins"][0]["joints"] = {1, 7};
  EXPECT_EQ(refusal(file.text()),
            "'part': skins[0].joints[1] is a joint that no scene holds" + again);
  file = withBones();
  file.json["skins"][0]["inverseBindMatrices"] = 0;
  EXPECT_EQ(
      refusal(file.text()),
      "'part': skins[0].inverseBindMatrices leads to an accessor that is none of a matrix for "
      "each joint" +
          again);
  file = withBones();
  file.json["skins"] = Json::array();
  EXPECT_THAT(refusal(file.text()), testing::HasSubstr("skins"));
  file = withBones();
  const int none = file.add<float>(std::vector<float>(12, 0), GltfFile::float32, "VEC4");
  file.json["meshes"][0]["primitives"][0]["attributes"]["WEIGHTS_0"] = none;
  EXPECT_EQ(refusal(file.text()),
            "'part': skins[0] moves a vertex by joints without weight" + again);
  file = withBones();
  const int below = file.add<float>(std::vector<float>(12, -1), GltfFile::float32, "VEC4");
  file.json["meshes"][0]["primitives"][0]["attributes"]["WEIGHTS_0"] = below;
  EXPECT_EQ(
      refusal(file.text()),
      "'part': meshes[0].primitives[0].attributes has joints or weights that are none" + again);
}

TEST(Gltf, LeavesOutWhatIsHidden) {
  GltfFile file = GltfFile::ofTriangle();
  file.addMesh(file.triangle());
  file.json["nodes"][0]["extensions"] = {{"KHR_node_visibility", {{"visible", true}}}};
  EXPECT_THAT(parseQuietly(file.text()).triangles, SizeIs(2));
  // What lies below is hidden too.
  file.json["nodes"].push_back(
      {{"children", {1}}, {"extensions", {{"KHR_node_visibility", {{"visible", false}}}}}});
  file.json["scenes"][0]["nodes"] = {0, 2};
  Warnings warnings;
  EXPECT_THAT(parse(file.text(), &warnings).triangles, SizeIs(1));
  EXPECT_THAT(warnings,
              ElementsAre("'part': left out 1 meshes that are hidden (KHR_node_visibility)"));
}

TEST(Gltf, SparseElementsReplaceOthers) {
  GltfFile file = GltfFile::ofTriangle();
  const int indices = file.addView(std::string("\2\0\0\0", 2));
  const float z = 5;
  std::string values(12, '\0');
  std::memcpy(values.data() + 8, &z, 4);
  Json& accessor = file.json["accessors"][0];
  accessor["sparse"] = {{"count", 1},
                        {"indices", {{"bufferView", indices}, {"componentType", GltfFile::uint16}}},
                        {"values", {{"bufferView", file.addView(values)}}}};
  EXPECT_EQ(parseQuietly(file.text()).vertices,
            (std::vector<Vec3d>{{0, 0, 0}, {1000, 0, 0}, {0, 0, 5000}}));
  accessor.erase("bufferView");
  EXPECT_EQ(parseQuietly(file.text()).vertices,
            (std::vector<Vec3d>{{0, 0, 0}, {0, 0, 0}, {0, 0, 5000}}))
      << "without data all others are zero";
}

TEST(Gltf, ReadsQuantizedPositions) {
  GltfFile file;
  const int bytes =
      file.add<std::int8_t>({-128, 0, 0, 0, 127, 0, 0, 0, 0, 0, 127, 0}, GltfFile::int8, "VEC3");
  file.json["accessors"][0]["normalized"] = true;
  file.json["accessors"][0]["count"] = 3;
  file.json["bufferViews"][0]["byteStride"] = 4;
  file.json["extensionsRequired"] = {"KHR_mesh_quantization"};
  file.addMesh({{"attributes", {{"POSITION", bytes}}}});
  EXPECT_EQ(parseQuietly(file.text()).vertices,
            (std::vector<Vec3d>{{-1000, 0, 0}, {1000, 0, 0}, {0, 0, 1000}}));
  file.json["accessors"][0].erase("normalized");
  EXPECT_EQ(parseQuietly(file.text()).vertices[0], Vec3d(-128000, 0, 0));
}

TEST(Gltf, ReadsColoursOfVerticesOfEveryType) {
  const auto colours = [](GltfFile& file, int accessor) {
    Json primitive = file.triangle();
    primitive["attributes"]["COLOR_0"] = accessor;
    primitive["material"] = 0;
    file.json["materials"] = {{{"alphaMode", "BLEND"}}};
    file.addMesh(primitive);
    return parseColours(file.text()).appearance->colours.at(0);
  };
  GltfFile bytes;
  const int of_bytes =
      bytes.add<std::uint8_t>({255, 51, 0, 102, 0, 0, 0, 0, 0, 0, 0, 0}, GltfFile::uint8, "VEC4");
  EXPECT_EQ(colours(bytes, of_bytes)[0], Vec4f(1, 0.2F, 0, 0.4F));
  GltfFile shorts;
  const int of_shorts =
      shorts.add<std::uint16_t>({65535, 13107, 0, 0, 0, 0, 0, 0, 0}, GltfFile::uint16, "VEC3");
  EXPECT_EQ(colours(shorts, of_shorts)[0], Vec4f(1, 0.2F, 0, 1));
  GltfFile floats;
  const int of_floats =
      floats.add<float>({0.25F, 2, -1, 0, 0, 0, 0, 0, 0}, GltfFile::float32, "VEC3");
  EXPECT_EQ(colours(floats, of_floats)[0], Vec4f(0.25F, 1, 0, 1));
}

/// A red texture of one texel, as PNG, is too much for a test by hand; these are its bytes.
std::string onePixelPng() {
  return std::string(
      "\x89PNG\r\n\x1a\n\0\0\0\rIHDR\0\0\0\1\0\0\0\1\x08\2\0\0\0\x90wS\xde"
      "\0\0\0\x0cIDATx\x9c"
      "c\xf8\xcf\xc0\0\0\3\1\1\0\xc9\xfe\x92\xef\0\0\0\0IEND\xae"
      "B`\x82",
      69);
}

/// A triangle with a texture; its corners have the coordinates (0, 0), (1, 0) and (0, 0.5).
GltfFile textured() {
  GltfFile file;
  Json primitive = file.triangle();
  primitive["attributes"]["TEXCOORD_0"] =
      file.add<float>({0, 0, 1, 0, 0, 0.5}, GltfFile::float32, "VEC2");
  primitive["attributes"]["TEXCOORD_1"] =
      file.add<std::uint16_t>({65535, 0, 0, 0, 0, 65535}, GltfFile::uint16, "VEC2");
  file.json["accessors"].back()["normalized"] = true;
  primitive["material"] = 0;
  file.json["images"] = {{{"bufferView", file.addView(onePixelPng())}, {"mimeType", "image/png"}}};
  file.json["textures"] = {{{"source", 0}}};
  file.json["materials"] = {
      {{"name", "skin"},
       {"pbrMetallicRoughness",
        {{"baseColorFactor", {0.5, 0.25, 1, 0.125}}, {"baseColorTexture", {{"index", 0}}}}}}};
  file.addMesh(primitive);
  return file;
}

TEST(Gltf, ATextureLiesOnTheSurface) {
  GltfFile file = textured();
  const Mesh mesh = parseColours(file.text());
  const Appearance& look = *mesh.appearance;
  ASSERT_THAT(look.textures, SizeIs(1));
  EXPECT_EQ(look.textures[0].texels.at(0)[0], 65535);
  EXPECT_EQ(look.textures[0].texels.at(0)[1], 0);
  EXPECT_EQ(look.coordinates.at(0), (Appearance::Coordinates{Vec2f(0, 0), {1, 0}, {0, 0.5}}));
  EXPECT_EQ(look.materials.at(0).name, "skin");
  EXPECT_EQ(look.materials[0].colour, Vec4f(0.5, 0.25, 1, 1)) << "opaque unless it says otherwise";
  EXPECT_EQ(look.materials[0].texture, 0U);
  EXPECT_TRUE(look.materials[0].is_smooth);
  EXPECT_THAT(look.colours, IsEmpty());
  EXPECT_EQ(parseQuietly(file.text()).appearance, nullptr) << "nobody asked for it";
  EXPECT_EQ(parseColours(GltfFile::ofTriangle().text()).appearance, nullptr) << "it has none";
}

TEST(Gltf, AReflectionTakesCoordinatesAlong) {
  GltfFile file = textured();
  file.json["nodes"][0]["scale"] = {1, 1, -1};
  const Mesh mesh = parseColours(file.text());
  EXPECT_EQ(mesh.triangles[0], (Mesh::Triangle{0, 2, 1}));
  EXPECT_EQ(mesh.appearance->coordinates[0],
            (Appearance::Coordinates{Vec2f(0, 0), {0, 0.5}, {1, 0}}));
}

TEST(Gltf, AMaterialChoosesItsSetOfCoordinatesAndTransformsThem) {
  GltfFile file = textured();
  Json& info = file.json["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"];
  info["texCoord"] = 1;
  EXPECT_EQ(parseColours(file.text()).appearance->coordinates[0],
            (Appearance::Coordinates{Vec2f(1, 0), {0, 0}, {0, 1}}));
  info["extensions"]["KHR_texture_transform"] = {{"offset", {0.5, 0.25}},
                                                 {"rotation", std::acos(-1.0) / 2},
                                                 {"scale", {2, 4}},
                                                 {"texCoord", 0}};
  const Appearance::Coordinates turned = parseColours(file.text()).appearance->coordinates[0];
  EXPECT_TRUE(turned[0].eq(Vec2f(0.5F, 0.25F), 1e-6F));
  EXPECT_TRUE(turned[1].eq(Vec2f(0.5F, -1.75F), 1e-6F)) << "scaled, turned from v to u, moved";
  EXPECT_TRUE(turned[2].eq(Vec2f(2.5F, 0.25F), 1e-6F));
}

TEST(Gltf, CoordinatesAreReadWithoutATexture) {
  GltfFile file = textured();
  file.json["meshes"][0]["primitives"][0].erase("material");
  const Mesh mesh = parseColours(file.text());
  ASSERT_NE(mesh.appearance, nullptr);
  EXPECT_EQ(mesh.appearance->coordinates[0][1], Vec2f(1, 0));
  EXPECT_THAT(mesh.appearance->textures, IsEmpty());
}

TEST(Gltf, SamplersWrapAndSmooth) {
  GltfFile file = textured();
  file.json["textures"][0]["sampler"] = 0;
  file.json["samplers"] = {{{"magFilter", 9728}, {"wrapS", 33071}, {"wrapT", 33648}}};
  const SurfaceMaterial material = parseColours(file.text()).appearance->materials[0];
  EXPECT_FALSE(material.is_smooth);
  EXPECT_THAT(material.wrap, ElementsAre(TextureWrap::clamp, TextureWrap::mirror));
}

TEST(Gltf, OpacityFollowsTheModeOfTheMaterial) {
  GltfFile file = textured();
  Json& material = file.json["materials"][0];
  const auto read = [&] { return parseColours(file.text()).appearance->materials[0]; };
  material["alphaMode"] = "BLEND";
  EXPECT_EQ(read().colour[3], 0.125F);
  EXPECT_EQ(read().opacity_cutoff, 0);
  material["alphaMode"] = "MASK";
  EXPECT_EQ(read().opacity_cutoff, 0.5F);
  material["alphaCutoff"] = 0.25;
  EXPECT_EQ(read().opacity_cutoff, 0.25F);
  EXPECT_EQ(read().colour[3], 0.125F);
  material["alphaMode"] = "OPAQUE";
  material["extensions"]["KHR_materials_transmission"] = {{"transmissionFactor", 0.75}};
  EXPECT_EQ(read().colour[3], 0.25F) << "what light passes through is clear";
  EXPECT_EQ(read().opacity_cutoff, 0);
}

TEST(Gltf, TheDiffuseColourOfSpecularGlossinessIsTheColour) {
  GltfFile file = textured();
  file.json["materials"][0]["extensions"]["KHR_materials_pbrSpecularGlossiness"] = {
      {"diffuseFactor", {1, 0, 0.5, 1}}};
  const SurfaceMaterial material = parseColours(file.text()).appearance->materials[0];
  EXPECT_EQ(material.colour, Vec4f(1, 0, 0.5, 1));
  EXPECT_EQ(material.texture, SurfaceMaterial::no_texture);
}

TEST(Gltf, AnImageIsDecodedOncePerUseOfItsOpacity) {
  GltfFile file = textured();
  const Json primitive = file.json["meshes"][0]["primitives"][0];
  for (const char* mode : {"OPAQUE", "BLEND", "BLEND"}) {
    Json copy = file.json["materials"][0];
    copy["alphaMode"] = mode;
    file.json["materials"].push_back(copy);
    Json again = primitive;
    again["material"] = file.json["materials"].size() - 1;
    file.addMesh(again);
  }
  const Mesh mesh = parseColours(file.text());
  EXPECT_THAT(mesh.appearance->textures, SizeIs(2));
  EXPECT_THAT(mesh.appearance->materials, SizeIs(4));
}

TEST(Gltf, OtherSourcesOfATextureStandBeforeTheOneForAll) {
  GltfFile file = textured();
  Json& texture = file.json["textures"][0];
  texture["extensions"]["KHR_texture_basisu"] = {{"source", 7}};
  EXPECT_THAT(parseColours(file.text()).appearance->textures, SizeIs(1)) << "the plain source";
  texture["extensions"]["EXT_texture_webp"] = {{"source", 0}};
  texture.erase("source");
  EXPECT_THAT(parseColours(file.text()).appearance->textures, SizeIs(1));
}

TEST(Gltf, TexturesWithoutCoordinatesAreIgnored) {
  GltfFile file = textured();
  file.json["meshes"][0]["primitives"][0]["attributes"].erase("TEXCOORD_0");
  Warnings warnings;
  const Mesh mesh = parseColours(file.text(), &warnings);
  EXPECT_EQ(mesh.appearance->materials[0].texture, SurfaceMaterial::no_texture);
  EXPECT_THAT(warnings, ElementsAre("'part': ignored the textures of 1 primitives without texture "
                                    "coordinates"));
}

TEST(Gltf, WildCoordinatesAndColoursAreZero) {
  GltfFile file = textured();
  const float nan = std::nanf("");
  Json& attributes = file.json["meshes"][0]["primitives"][0]["attributes"];
  attributes["TEXCOORD_0"] =
      file.add<float>({0, nan, 1, INFINITY, 0, 1}, GltfFile::float32, "VEC2");
  attributes["COLOR_0"] = file.add<float>({nan, 1, 1, 1, 1, 1, 1, 1, 1}, GltfFile::float32, "VEC3");
  Warnings warnings;
  const Mesh mesh = parseColours(file.text(), &warnings);
  EXPECT_EQ(mesh.appearance->coordinates[0],
            (Appearance::Coordinates{Vec2f(0, 0), {0, 0}, {0, 1}}));
  EXPECT_EQ(mesh.appearance->colours[0][0], Vec4f(0, 1, 1, 1));
  EXPECT_THAT(warnings, ElementsAre("'part': took 0 for 3 texture coordinates and colours that are "
                                    "not finite"));
}

TEST(Gltf, TrianglesWithoutALookAreWhiteBesideOthers) {
  GltfFile file = textured();
  file.addMesh(file.triangle());
  const Mesh mesh = parseColours(file.text());
  const Appearance& look = *mesh.appearance;
  EXPECT_THAT(look.coordinates, SizeIs(2));
  EXPECT_EQ(look.materials[look.material[1]].colour, Vec4f(1, 1, 1, 1));
  EXPECT_EQ(look.materials[look.material[1]].texture, SurfaceMaterial::no_texture);
}

/// The triangle and its mirror image, compressed by Draco, with colours as attribute 1.
}  // namespace
}  // namespace vdbdither::test
