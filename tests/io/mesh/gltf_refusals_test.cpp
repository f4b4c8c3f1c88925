#include <cmath>
#include <cstdint>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "io/mesh/mesh_reader.h"
#include "tests/support/gltf_file.h"
#include "tests/support/parsed_meshes.h"
#include "vdbdither/model/errors.h"

namespace vdbdither::test {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using Json = GltfFile::Json;

const std::string again = "; export the file again";

/// The refusal of a file with the triangle, after `change`.
template <class Change>
std::string refusalAfter(const Change& change) {
  GltfFile file = GltfFile::ofTriangle();
  change(file.json);
  return refusal(file.text());
}

TEST(GltfRefusals, OtherVersionsAndOtherJson) {
  EXPECT_THAT(refusal("{}"), HasSubstr("'part': a JSON text without 'asset', which is not glTF"));
  EXPECT_THAT(refusal("{}", "part.obj"), HasSubstr("glTF"));
  EXPECT_EQ(refusalAfter([](Json& json) { json["asset"]["version"] = "1.0"; }),
            "'part': a glTF of version '1.0'; export glTF 2.0");
  EXPECT_EQ(refusalAfter([](Json& json) { json["asset"]["minVersion"] = "3\n"; }),
            "'part': a glTF of version '3?'; export glTF 2.0");
  EXPECT_EQ(refusal("[]", "part.gltf"), "'part.gltf': the JSON text must be an object" + again);
  EXPECT_EQ(refusal("{\"asset\": 1,}"),
            "'part', byte 12: here the text is not JSON; export or download the file again");
  EXPECT_EQ(refusal("{\"asset\": 1e999}"),
            "'part', byte 14: here a number is too large; export the file again");
  EXPECT_EQ(refusal("{\"asset\": {\"version\": \"\xFF\"}}"),
            "'part', byte 23: here the text is not JSON; export or download the file again");
}

TEST(GltfRefusals, ExtensionsThatItNeedsByName) {
  EXPECT_EQ(refusalAfter([](Json& json) {
              json["extensionsRequired"] = {"KHR_materials_unlit", "EXT_mesh_gpu_instancing"};
            }),
            "'part': needs the extension 'EXT_mesh_gpu_instancing', which is not read; export it "
            "without");
  EXPECT_EQ(refusalAfter([](Json& json) {
              json["nodes"][0]["extensions"] = {{"EXT_mesh_gpu_instancing", Json::object()}};
            }),
            "'part': nodes[0] is repeated by EXT_mesh_gpu_instancing, which is not read" + again);
  EXPECT_EQ(refusalAfter([](Json& json) { json["extensionsRequired"] = {"A\x1B[31m"}; }),
            "'part': needs the extension 'A?[31m', which is not read; export it without");
}

TEST(GltfRefusals, ImagesOfBasisuByName) {
  GltfFile file;
  Json primitive = file.triangle();
  primitive["attributes"]["TEXCOORD_0"] =
      file.add<float>({0, 0, 0, 0, 0, 0}, GltfFile::float32, "VEC2");
  primitive["material"] = 0;
  file.addMesh(primitive);
  file.json["materials"] = {{{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 0}}}}}}};
  file.json["textures"] = {{{"extensions", {{"KHR_texture_basisu", {{"source", 0}}}}}}};
  file.json["extensionsRequired"] = {"KHR_texture_basisu"};
  EXPECT_EQ(parseQuietly(file.text()).triangles.size(), 1U) << "the shape needs no image";
  const std::string text = file.text();
  try {
    parseMesh(MeshFile("part", text, {}, MeshColours::read));
    FAIL();
  } catch (const DataError& error) {
    EXPECT_EQ(std::string(error.what()),
              "'part': textures[0] has only an image of the extension KHR_texture_basisu, which is "
              "not read: use PNG, JPEG or WebP" +
                  again);
  }
}

TEST(GltfRefusals, NestingTooDeep) {
  const std::string deep = "'part': its JSON nests deeper than 64 levels; export it again";
  EXPECT_EQ(refusal("{\"a\":" + std::string(1'000'000, '[')), deep);
  std::string objects = "{";
  for (int i = 0; i < 100'000; ++i) objects += "\"a\":{";
  EXPECT_EQ(refusal(objects), deep);
}

TEST(GltfRefusals, MoreValuesThanMemoryShouldHold) {
  std::string text = "{\"a\":[";
  for (int i = 0; i < 2'100'000; ++i) text += "{},";
  EXPECT_EQ(refusal(text + "0]}"),
            "'part': its JSON has more than 2097152 values; split the scene");
}

TEST(GltfRefusals, NumbersThatAreNoCounts) {
  for (const Json& count : {Json(-1), Json(1.5), Json(1e300), Json("3"), Json(nullptr)}) {
    EXPECT_EQ(refusalAfter([&](Json& json) { json["accessors"][0]["count"] = count; }),
              "'part': accessors[0].count must be a whole number from 0 on" + again);
  }
  EXPECT_EQ(refusalAfter([&](Json& json) { json["accessors"][0].erase("count"); }),
            "'part': accessors[0].count is missing" + again);
}

TEST(GltfRefusals, AccessorsOutOfRange) {
  const std::string beyond = "'part': accessors[0] reaches beyond its data" + again;
  const auto with = [](const char* key, std::uint64_t value) {
    return refusalAfter([&](Json& json) { json["accessors"][0][key] = value; });
  };
  EXPECT_EQ(with("count", 4), beyond);
  EXPECT_EQ(with("byteOffset", 1), beyond);
  EXPECT_EQ(with("byteOffset", std::uint64_t{1} << 53), beyond);
  EXPECT_EQ(with("count", std::uint64_t{1} << 53),
            "'part': accessors[0].count is more than 4294967295" + again);
  EXPECT_EQ(with("count", std::uint64_t{1} << 60),
            "'part': accessors[0].count must be a whole number from 0 on" + again);
  EXPECT_EQ(with("count", 4294967295), beyond);
  EXPECT_EQ(with("bufferView", 1), "'part': bufferViews[1] is named, but there are 1" + again);
  EXPECT_EQ(with("componentType", 5124),
            "'part': accessors[0].componentType is not a component type" + again);
  EXPECT_EQ(refusalAfter([](Json& json) { json["accessors"][0]["type"] = "MAT3"; }),
            "'part': accessors[0].type must be SCALAR, VEC2, VEC3, VEC4 or MAT4" + again);
  EXPECT_EQ(refusalAfter([](Json& json) { json["bufferViews"][0]["byteStride"] = 1ULL << 53; }),
            beyond);
}

TEST(GltfRefusals, BufferViewsOutsideOfTheirBuffer) {
  const std::string outside =
      "'part': bufferViews[0] lies outside of its buffer of 36 bytes" + again;
  const auto with = [](const char* key, std::uint64_t value) {
    return refusalAfter([&](Json& json) { json["bufferViews"][0][key] = value; });
  };
  EXPECT_EQ(with("byteLength", 37), outside);
  EXPECT_EQ(with("byteLength", std::uint64_t{1} << 53), outside);
  EXPECT_EQ(with("byteOffset", 1), outside);
  EXPECT_EQ(with("byteOffset", std::uint64_t{1} << 53), outside);
  EXPECT_EQ(with("buffer", 1), "'part': buffers[1] is named, but there are 1" + again);
}

TEST(GltfRefusals, BuffersShorterThanTheySay) {
  const auto with = [](const Json& buffer) {
    return refusalAfter([&](Json& json) { json["buffers"] = Json::array({buffer}); });
  };
  EXPECT_EQ(with({{"byteLength", 4294967296}, {"uri", "data:;base64,AAAA"}}),
            "'part': buffers[0] has 3 bytes of the 4294967296 that it should have" + again);
  EXPECT_EQ(with({{"byteLength", 36}}), "'part': buffers[0] has no data" + again);
  EXPECT_EQ(with({{"byteLength", 36}, {"uri", "data:;base64,A"}}),
            "'part': buffer buffers[0].uri: its Base64 data are damaged" + again);
  EXPECT_EQ(with({{"byteLength", 36}, {"uri", "data:;base64,A*=="}}),
            "'part': buffer buffers[0].uri: its Base64 data are damaged" + again);
  EXPECT_EQ(with({{"byteLength", 36}, {"uri", "data:text/plain,A"}}),
            "'part': buffer buffers[0].uri: its data are not in Base64" + again);
}

TEST(GltfRefusals, WildIndices) {
  GltfFile file;
  Json primitive = file.triangle();
  primitive["indices"] = file.add<std::uint16_t>({0, 1, 3}, GltfFile::uint16, "SCALAR");
  file.addMesh(primitive);
  const std::string indices = "'part': meshes[0].primitives[0].indices ";
  EXPECT_EQ(refusal(file.text()),
            indices + "name vertex 3, but there are 3, counted from 0" + again);
  file.json["meshes"][0]["primitives"][0]["indices"] = 0;
  EXPECT_EQ(refusal(file.text()), indices + "leads to an accessor that is none of indices" + again);
}

TEST(GltfRefusals, WildSparseIndices) {
  GltfFile file = GltfFile::ofTriangle();
  const int places = file.addView(std::string("\1\1\3", 3));
  const int values = file.addView(std::string(36, '\0'));
  const auto with = [&](int offset, int count) {
    file.json["accessors"][0]["sparse"] = {
        {"count", count},
        {"indices",
         {{"bufferView", places}, {"byteOffset", offset}, {"componentType", GltfFile::uint8}}},
        {"values", {{"bufferView", values}}}};
    return refusal(file.text());
  };
  const std::string sparse = "'part': accessors[0].sparse.";
  EXPECT_EQ(with(0, 2), sparse + "indices does not ascend" + again);
  EXPECT_EQ(with(1, 2), sparse + "indices has an index out of range" + again);
  EXPECT_EQ(with(0, 4), sparse + "count is more than the accessor holds" + again);
  EXPECT_EQ(with(2, 2), sparse + "indices reaches beyond its data" + again);
}

TEST(GltfRefusals, AttributesOfOtherLengths) {
  GltfFile file;
  Json primitive = file.triangle();
  primitive["attributes"]["COLOR_0"] =
      file.add<float>({1, 1, 1, 1, 1, 1}, GltfFile::float32, "VEC3");
  file.addMesh(primitive);
  const std::string text = file.text();
  EXPECT_THROW(parseMesh(MeshFile("part", text, {}, MeshColours::read)), DataError);
  EXPECT_EQ(parseQuietly(text).triangles.size(), 1U) << "colours that nobody asked for";
}

TEST(GltfRefusals, PrimitivesOfNoShape) {
  const auto with = [](const char* key, const Json& value) {
    return refusalAfter([&](Json& json) { json["meshes"][0]["primitives"][0][key] = value; });
  };
  EXPECT_EQ(with("mode", 7),
            "'part': meshes[0].primitives[0].mode must be a whole number from 0 to 6" + again);
  EXPECT_EQ(with("attributes", Json::object()),
            "'part': meshes[0].primitives[0].attributes.POSITION is missing" + again);
  EXPECT_EQ(
      refusalAfter([](Json& json) { json["accessors"][0]["type"] = "VEC2"; }),
      "'part': meshes[0].primitives[0].attributes has no positions with three coordinates" + again);
  EXPECT_EQ(refusalAfter([](Json& json) { json["meshes"][0].erase("primitives"); }),
            "'part': holds no triangles; export a surface mesh");
  EXPECT_EQ(refusalAfter([](Json& json) { json.erase("meshes"); }),
            "'part': meshes[0] is named, but there are 0" + again);
}

TEST(GltfRefusals, PositionsThatAreNotFinite) {
  GltfFile file;
  file.addMesh({{"attributes",
                 {{"POSITION", file.add<float>({0, 0, 0, std::nanf(""), 0, 0, 0, 1, 0},
                                               GltfFile::float32, "VEC3")}}}});
  EXPECT_EQ(refusal(file.text()),
            "'part': meshes[0].primitives[0] has a vertex that is not finite (nan 0 0); repair the "
            "mesh");
  EXPECT_THAT(refusalAfter([](Json& json) {
                json["nodes"][0]["scale"] = {1e308, 1, 1};
              }),
              HasSubstr("a node moves a vertex to where it is not finite (nan 0 0)"));
}

TEST(GltfRefusals, NodesThatAreNoTree) {
  const std::string twice =
      "'part': nodes[0] has more than one parent, or is among its own children";
  EXPECT_EQ(refusalAfter([](Json& json) { json["nodes"][0]["children"] = {0}; }), twice + again);
  EXPECT_EQ(refusalAfter([](Json& json) {
              json["nodes"].push_back({{"children", {0, 0}}});
              json["scenes"][0]["nodes"] = {1};
            }),
            twice + again);
  EXPECT_EQ(refusalAfter([](Json& json) {
              for (int i = 1; i < 100; ++i) json["nodes"].push_back({{"children", {i + 1}}});
              json["scenes"][0]["nodes"] = {1};
            }),
            "'part': nodes[65] is nested deeper than 64 levels" + again);
  EXPECT_EQ(refusalAfter([](Json& json) {
              json["nodes"][0]["rotation"] = {0, 1};
            }),
            "'part': nodes[0].rotation has not 4 numbers" + again);
  EXPECT_EQ(refusalAfter([](Json& json) { json["scene"] = 1; }),
            "'part': scenes[1] is named, but there are 1" + again);
}

TEST(GltfRefusals, MeshesThatAreUsedTooOften) {
  GltfFile file;
  std::vector<float> positions(9 * 20'000);
  file.addMesh({{"attributes", {{"POSITION", file.add(positions, GltfFile::float32, "VEC3")}}}});
  for (int i = 0; i < 2000; ++i) {
    file.json["nodes"].push_back({{"mesh", 0}});
    file.json["scenes"][0]["nodes"].push_back(i + 1);
  }
  EXPECT_THAT(refusal(file.text()), HasSubstr("MiB of memory, too much for its size"));
}

TEST(GltfRefusals, AccessorsWithoutDataThatClaimBillions) {
  const std::string message = refusalAfter([](Json& json) {
    json["accessors"][0].erase("bufferView");
    json["accessors"][0]["count"] = 4294967295;
  });
  EXPECT_THAT(message, HasSubstr("MiB of memory, too much for its size"));
}

TEST(GltfRefusals, CompressedViewsThatClaimTooMuch) {
  GltfFile file = GltfFile::ofTriangle();
  const auto with = [&](const char* key, const Json& value) {
    Json extension = {{"buffer", 0},
                      {"byteLength", 36},
                      {"byteStride", 12},
                      {"mode", "ATTRIBUTES"},
                      {"count", 3}};
    extension[key] = value;
    file.json["bufferViews"][0]["extensions"]["EXT_meshopt_compression"] = extension;
    return refusal(file.text());
  };
  const std::string path = "'part': bufferViews[0].extensions.EXT_meshopt_compression";
  EXPECT_EQ(with("count", 1'000'000),
            path + ".count does not fit the size of the compressed data" + again);
  EXPECT_EQ(with("count", 3), path + " cannot be decompressed: its data are damaged" + again);
  EXPECT_EQ(with("byteStride", 6), path + ".byteStride is not possible" + again);
  EXPECT_EQ(with("mode", "OTHER"), path + ".mode is not a mode of the extension" + again);
  EXPECT_EQ(with("filter", "QUATERNION"), path + ".filter is not possible" + again);
}

TEST(GltfRefusals, GlbThatIsCutOffOrFramedWrongly) {
  const std::string glb = GltfFile::ofTriangle().glb();
  EXPECT_EQ(refusal(glb.substr(0, 8)),
            "'part': the header is cut off; export or download it again");
  EXPECT_EQ(refusal(glb.substr(0, 40)), "'part': cut off: 40 of " + std::to_string(glb.size()) +
                                            " bytes; export or download it again");
  const auto changed = [&](std::size_t at, char value) {
    std::string copy = glb;
    copy[at] = value;
    return refusal(copy);
  };
  EXPECT_EQ(changed(4, 1), "'part': a binary glTF of version 1; export glTF 2.0");
  EXPECT_EQ(changed(15, 1),
            "'part', byte 12: a chunk reaches beyond the end; export or download it again");
  EXPECT_EQ(changed(16, 'B'),
            "'part', byte 12: the first chunk must be JSON; export or download it again");
  EXPECT_EQ(refusal(glbOf("{}", "").substr(0, 8) + std::string("\x0c\0\0\0", 4)),
            "'part': the JSON is missing; export or download it again");
  Warnings warnings;
  parse(glb + "more", &warnings);
  EXPECT_THAT(warnings, ElementsAre("'part': ignored 4 bytes after the end"));
}

TEST(GltfRefusals, NeverPassesOffAHalfAsTheWhole) {
  expectEveryPrefixIsReadOrRefused(GltfFile::ofTriangle().glb(), true);
  expectEveryPrefixIsReadOrRefused(GltfFile::ofTriangle().text(), true);
}

TEST(GltfRefusals, ASpoiltTextIsReadOrRefused) {
  expectSpoiltBytesAreReadOrRefused(GltfFile::ofTriangle().text());
}

}  // namespace
}  // namespace vdbdither::test
