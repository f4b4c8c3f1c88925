// glTF 2.0: ISO/IEC 12113:2022, and the extension KHR_draco_mesh_compression:
// https://github.com/KhronosGroup/glTF/tree/main/extensions/2.0/Khronos/KHR_draco_mesh_compression

#include "io/mesh/glb_encoder.h"

#include <algorithm>
#include <array>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include "io/mesh/draco_mesh.h"

namespace vdbdither {

using Json = nlohmann::ordered_json;

namespace {

constexpr const char* compression = "KHR_draco_mesh_compression";

std::uint64_t wholeWords(std::uint64_t bytes) { return (bytes + 3) / 4 * 4; }

}  // namespace

GlbEncoder::GlbEncoder(const std::filesystem::path& path, const VertexExtras& extras)
    : IndexedMeshEncoder(path), extras_(extras) {
  // More than any counts and bounds need.
  constexpr std::uint64_t room = 512;
  json_bytes_ = wholeWords(glbDocument(extras_, mesh_).dump().size() + room);
  const std::string text = beginning();
  bytes_ = text.size();
  file_.append(text);
}

void GlbEncoder::vertex(const MeshVertex& vertex) {
  count(glbVertexBytes(extras_));
  ++mesh_.vertices;
  mesh_.take(vertex.position);
  file_.appendValue(vertex.position);
  if (extras_.colour) file_.appendValue(glbColour(vertex.colour));
  if (extras_.quality) file_.appendValue(vertex.quality);
}

void GlbEncoder::triangle(const Mesh::Triangle& triangle) {
  count(sizeof(triangle));
  ++mesh_.triangles;
  faces_.appendValue(triangle);
}

void GlbEncoder::finish(std::uint64_t /*vertices*/, std::uint64_t /*triangles*/) {
  file_.appendAllOf(faces_);
  const std::string text = beginning();
  file_.patch(0, text.data(), text.size());
}

std::string GlbEncoder::beginning() const {
  return glbBeginning(
      glbDocument(extras_, mesh_).dump(), json_bytes_,
      mesh_.vertices * glbVertexBytes(extras_) + mesh_.triangles * sizeof(Mesh::Triangle));
}

void GlbEncoder::count(std::uint64_t bytes) {
  bytes_ += bytes;
  checkGlbBytes(bytes_);
}

void CompressedGlbEncoder::finish(std::uint64_t vertices, std::uint64_t /*triangles*/) {
  Json ids{{"POSITION", encoding_.positions(std::exchange(positions_, {}))}};
  if (extras_.colour) {
    std::vector<std::array<std::uint16_t, 4>> linear(colours_.size());
    std::transform(colours_.begin(), colours_.end(), linear.begin(), glbColour);
    colours_ = {};
    ids["COLOR_0"] = encoding_.colours(linear);
  }
  if (extras_.quality) ids["_QUALITY"] = encoding_.numbers(std::exchange(qualities_, {}));
  const std::string data = encoding_.encode(vertices);

  // What a reader gets: Draco splits vertices, drops triangles without area, and rounds positions.
  const DracoMesh decoded(data);
  GlbMesh mesh;
  mesh.vertices = decoded.points();
  mesh.triangles = decoded.triangles().size();
  const std::vector<double> positions = decoded.values(DracoAttribute::position).values;
  for (std::size_t n = 0; n < positions.size(); n += 3)
    mesh.take(openvdb::Vec3s(openvdb::Vec3d(&positions[n])));

  Json document = glbDocument(extras_, mesh);
  for (Json& accessor : document["accessors"]) {
    accessor.erase("bufferView");
    accessor.erase("byteOffset");
  }
  document["bufferViews"] = Json::array({{{"buffer", 0}, {"byteLength", data.size()}}});
  document["buffers"] = Json::array({{{"byteLength", data.size()}}});
  document["meshes"][0]["primitives"][0]["extensions"][compression] = {{"bufferView", 0},
                                                                       {"attributes", ids}};
  document["extensionsUsed"] = document["extensionsRequired"] = Json::array({compression});

  const std::string json = document.dump();
  const std::uint64_t binary_bytes = wholeWords(data.size());
  const std::string text = glbBeginning(json, wholeWords(json.size()), binary_bytes);
  checkGlbBytes(text.size() + binary_bytes);
  file_.append(text);
  file_.append(data);
  file_.append(std::string(binary_bytes - data.size(), '\0'));
}

}  // namespace vdbdither
