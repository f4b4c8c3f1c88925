// glTF 2.0: ISO/IEC 12113:2022, sections 3.6 and 4.4.

#include "io/mesh/glb_encoder.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

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

/// Linear light, as shares of 65535.
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

GlbEncoder::GlbEncoder(const std::filesystem::path& path, const VertexExtras& extras)
    : IndexedMeshEncoder(path),
      extras_(extras),
      low_(std::numeric_limits<float>::max()),
      high_(std::numeric_limits<float>::lowest()) {
  // More than any counts and bounds need.
  constexpr std::uint64_t room = 512;
  json_bytes_ = (json(0, 0).size() + room + 3) / 4 * 4;
  const std::string text = beginning(0, 0);
  bytes_ = text.size();
  file_.append(text);
}

void GlbEncoder::vertex(const MeshVertex& vertex) {
  count(stride());
  for (int axis = 0; axis < 3; ++axis) {
    low_[axis] = std::min(low_[axis], vertex.position[axis]);
    high_[axis] = std::max(high_[axis], vertex.position[axis]);
  }
  file_.appendValue(vertex.position);
  if (extras_.colour) {
    static const std::array<std::uint16_t, 256> shares = linearShares();
    const auto& [red, green, blue] = vertex.colour;
    file_.appendValue(
        std::array<std::uint16_t, 4>{shares[red], shares[green], shares[blue], 65535});
  }
  if (extras_.quality) file_.appendValue(vertex.quality);
}

void GlbEncoder::triangle(const Mesh::Triangle& triangle) {
  count(sizeof(triangle));
  faces_.appendValue(triangle);
}

void GlbEncoder::finish(std::uint64_t vertices, std::uint64_t triangles) {
  file_.appendAllOf(faces_);
  const std::string text = beginning(vertices, triangles);
  file_.patch(0, text.data(), text.size());
}

std::uint64_t GlbEncoder::stride() const {
  return sizeof(Vec3s) + (extras_.colour ? 8U : 0U) + (extras_.quality ? 4U : 0U);
}

std::string GlbEncoder::json(std::uint64_t vertices, std::uint64_t triangles) const {
  const std::uint64_t vertex_bytes = vertices * stride();
  const std::uint64_t triangle_bytes = triangles * sizeof(Mesh::Triangle);
  Json accessors = Json::array();
  Json attributes = Json::object();
  std::uint64_t offset = 0;
  const auto addAttribute = [&](const char* name, Json accessor, std::uint64_t bytes) {
    attributes[name] = accessors.size();
    accessor["bufferView"] = 0;
    accessor["byteOffset"] = offset;
    accessor["count"] = vertices;
    accessors.push_back(accessor);
    offset += bytes;
  };
  addAttribute("POSITION",
               {{"componentType", float_type},
                {"type", "VEC3"},
                {"min", {low_.x(), low_.y(), low_.z()}},
                {"max", {high_.x(), high_.y(), high_.z()}}},
               sizeof(Vec3s));
  if (extras_.colour)
    addAttribute("COLOR_0",
                 {{"componentType", uint16_type}, {"type", "VEC4"}, {"normalized", true}}, 8);
  if (extras_.quality)
    addAttribute("_QUALITY", {{"componentType", float_type}, {"type", "SCALAR"}}, 4);
  Json primitive{{"attributes", attributes}, {"indices", accessors.size()}};
  accessors.push_back({{"componentType", uint32_type},
                       {"type", "SCALAR"},
                       {"bufferView", 1},
                       {"count", 3 * triangles}});

  Json asset{{"version", "2.0"}, {"generator", "vdbdither"}};
  if (!extras_.comment.empty()) asset["extras"] = {{"comment", extras_.comment}};
  Json text{{"asset", asset},
            {"scene", 0},
            {"scenes", Json::array({{{"nodes", {0}}}})},
            {"nodes", Json::array({{{"mesh", 0}, {"scale", {0.001, 0.001, 0.001}}}})},
            {"accessors", accessors},
            {"bufferViews", Json::array({{{"buffer", 0},
                                          {"byteLength", vertex_bytes},
                                          {"byteStride", stride()},
                                          {"target", 34962}},
                                         {{"buffer", 0},
                                          {"byteOffset", vertex_bytes},
                                          {"byteLength", triangle_bytes},
                                          {"target", 34963}}})},
            {"buffers", Json::array({{{"byteLength", vertex_bytes + triangle_bytes}}})}};
  if (extras_.colour) {
    primitive["material"] = 0;
    text["materials"] = Json::array({{{"pbrMetallicRoughness", {{"metallicFactor", 0}}}}});
  }
  text["meshes"] = Json::array({{{"primitives", Json::array({primitive})}}});
  return text.dump();
}

std::string GlbEncoder::beginning(std::uint64_t vertices, std::uint64_t triangles) const {
  const std::uint64_t binary_bytes = vertices * stride() + triangles * sizeof(Mesh::Triangle);
  std::string text = "glTF";
  append(text, 2);
  append(text, header_bytes + chunk_header_bytes + json_bytes_ + chunk_header_bytes + binary_bytes);
  append(text, json_bytes_);
  text += "JSON";
  text += json(vertices, triangles);
  text.resize(header_bytes + chunk_header_bytes + json_bytes_, ' ');
  append(text, binary_bytes);
  text.append("BIN\0", 4);
  return text;
}

void GlbEncoder::count(std::uint64_t bytes) {
  bytes_ += bytes;
  if (bytes_ > std::numeric_limits<std::uint32_t>::max())
    throw DataError("a .glb file holds at most 4 GiB; take fewer --layers, or write a .ply file");
}

}  // namespace vdbdither
