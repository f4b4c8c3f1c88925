// glTF 2.0: ISO/IEC 12113:2022, sections 3.6 and 4.4.

#include "io/mesh/glb_document.h"

#include <cmath>

#include <nlohmann/json.hpp>

#include "io/image/srgb.h"
#include "vdbdither/model/errors.h"

namespace vdbdither {

using Json = nlohmann::ordered_json;
using openvdb::Vec3s;

namespace {

constexpr std::uint64_t header_bytes = 12;
constexpr std::uint64_t chunk_header_bytes = 8;
constexpr int float_type = 5126;
constexpr int uint16_type = 5123;
constexpr int uint32_type = 5125;

std::array<std::uint16_t, 256> linearShares() {
  std::array<std::uint16_t, 256> shares{};
  for (std::size_t i = 0; i < shares.size(); ++i) {
    shares[i] =
        static_cast<std::uint16_t>(std::lround(65535 * linearOfSrgb(static_cast<double>(i) / 255)));
  }
  return shares;
}

void append(std::string& text, std::uint64_t value) {
  for (int byte = 0; byte < 4; ++byte)
    text.push_back(static_cast<char>(value >> (8 * byte) & 0xFF));
}

}  // namespace

std::uint64_t glbVertexBytes(const VertexExtras& extras) {
  return sizeof(Vec3s) + (extras.colour ? 8U : 0U) + (extras.quality ? 4U : 0U);
}

std::array<std::uint16_t, 4> glbColour(const std::array<std::uint8_t, 3>& srgb) {
  static const std::array<std::uint16_t, 256> shares = linearShares();
  return {shares[srgb[0]], shares[srgb[1]], shares[srgb[2]], 65535};
}

Json glbDocument(const VertexExtras& extras, const GlbMesh& mesh) {
  const std::uint64_t stride = glbVertexBytes(extras);
  const std::uint64_t vertex_bytes = mesh.vertices * stride;
  const std::uint64_t triangle_bytes = mesh.triangles * sizeof(Mesh::Triangle);
  Json accessors = Json::array();
  Json attributes = Json::object();
  std::uint64_t offset = 0;
  const auto addAttribute = [&](const char* name, Json accessor, std::uint64_t bytes) {
    attributes[name] = accessors.size();
    accessor["bufferView"] = 0;
    accessor["byteOffset"] = offset;
    accessor["count"] = mesh.vertices;
    accessors.push_back(accessor);
    offset += bytes;
  };
  addAttribute("POSITION",
               {{"componentType", float_type},
                {"type", "VEC3"},
                {"min", {mesh.low.x(), mesh.low.y(), mesh.low.z()}},
                {"max", {mesh.high.x(), mesh.high.y(), mesh.high.z()}}},
               sizeof(Vec3s));
  if (extras.colour)
    addAttribute("COLOR_0",
                 {{"componentType", uint16_type}, {"type", "VEC4"}, {"normalized", true}}, 8);
  if (extras.quality)
    addAttribute("_QUALITY", {{"componentType", float_type}, {"type", "SCALAR"}}, 4);
  Json primitive{{"attributes", attributes}, {"indices", accessors.size()}};
  accessors.push_back({{"componentType", uint32_type},
                       {"type", "SCALAR"},
                       {"bufferView", 1},
                       {"count", 3 * mesh.triangles}});

  Json asset{{"version", "2.0"}, {"generator", "vdbdither"}};
  if (!extras.comment.empty()) asset["extras"] = {{"comment", extras.comment}};
  Json document{{"asset", asset},
                {"scene", 0},
                {"scenes", Json::array({{{"nodes", {0}}}})},
                {"nodes", Json::array({{{"mesh", 0}, {"scale", {0.001, 0.001, 0.001}}}})},
                {"accessors", accessors},
                {"bufferViews", Json::array({{{"buffer", 0},
                                              {"byteLength", vertex_bytes},
                                              {"byteStride", stride},
                                              {"target", 34962}},
                                             {{"buffer", 0},
                                              {"byteOffset", vertex_bytes},
                                              {"byteLength", triangle_bytes},
                                              {"target", 34963}}})},
                {"buffers", Json::array({{{"byteLength", vertex_bytes + triangle_bytes}}})}};
  if (extras.colour) {
    primitive["material"] = 0;
    document["materials"] = Json::array({{{"pbrMetallicRoughness", {{"metallicFactor", 0}}}}});
  }
  document["meshes"] = Json::array({{{"primitives", Json::array({primitive})}}});
  return document;
}

std::string glbBeginning(const std::string& json, std::uint64_t json_bytes,
                         std::uint64_t binary_bytes) {
  std::string text = "glTF";
  append(text, 2);
  append(text, header_bytes + chunk_header_bytes + json_bytes + chunk_header_bytes + binary_bytes);
  append(text, json_bytes);
  text += "JSON";
  text += json;
  text.resize(header_bytes + chunk_header_bytes + json_bytes, ' ');
  append(text, binary_bytes);
  text.append("BIN\0", 4);
  return text;
}

void checkGlbBytes(std::uint64_t bytes) {
  if (bytes > std::numeric_limits<std::uint32_t>::max())
    throw DataError("a .glb file holds at most 4 GiB; take fewer --layers, or write a .ply file");
}

}  // namespace vdbdither
