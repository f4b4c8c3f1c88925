#include "tests/support/gltf_file.h"

namespace vdbdither::test {

namespace {

std::string inFourBytes(std::size_t value) {
  const auto number = static_cast<std::uint32_t>(value);
  std::string bytes(4, '\0');
  std::memcpy(bytes.data(), &number, 4);
  return bytes;
}

}  // namespace

std::string base64(std::string_view bytes) {
  constexpr std::string_view alphabet =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    std::uint32_t bits = 0;
    for (std::size_t k = 0; k < 3; ++k)
      bits = bits << 8 | (i + k < bytes.size() ? static_cast<unsigned char>(bytes[i + k]) : 0U);
    for (std::size_t k = 0; k < 4; ++k)
      text.push_back(i + k > bytes.size() ? '=' : alphabet[bits >> (18 - 6 * k) & 63]);
  }
  return text;
}

std::string glbOf(std::string json, std::string binary) {
  json.resize((json.size() + 3) / 4 * 4, ' ');
  binary.resize((binary.size() + 3) / 4 * 4, '\0');
  std::string chunks = inFourBytes(json.size()) + "JSON" + json;
  if (!binary.empty()) chunks += inFourBytes(binary.size()) + std::string("BIN\0", 4) + binary;
  return "glTF" + inFourBytes(2) + inFourBytes(12 + chunks.size()) + chunks;
}

int GltfFile::addView(std::string_view bytes) {
  buffer.resize((buffer.size() + 3) / 4 * 4, '\0');
  json["bufferViews"].push_back(
      {{"buffer", 0}, {"byteOffset", buffer.size()}, {"byteLength", bytes.size()}});
  buffer += bytes;
  return static_cast<int>(json["bufferViews"].size()) - 1;
}

GltfFile::Json GltfFile::triangle() {
  const int positions = add<float>({0, 0, 0, 1, 0, 0, 0, 1, 0}, float32, "VEC3");
  return {{"attributes", {{"POSITION", positions}}}};
}

void GltfFile::addMesh(const Json& primitive, const Json& node) {
  json["meshes"].push_back({{"primitives", Json::array({primitive})}});
  Json placed = node;
  placed["mesh"] = json["meshes"].size() - 1;
  json["nodes"].push_back(placed);
  json["scene"] = 0;
  json["scenes"][0]["nodes"].push_back(json["nodes"].size() - 1);
}

std::string GltfFile::text() const {
  Json whole = json;
  if (!whole.contains("buffers")) {
    whole["buffers"] =
        Json::array({{{"byteLength", buffer.size()},
                      {"uri", "data:application/octet-stream;base64," + base64(buffer)}}});
  }
  return whole.dump();
}

std::string GltfFile::glb() const {
  Json whole = json;
  whole["buffers"] = Json::array({{{"byteLength", buffer.size()}}});
  return glbOf(whole.dump(), buffer);
}

GltfFile GltfFile::ofTriangle() {
  GltfFile file;
  file.addMesh(file.triangle());
  return file;
}

}  // namespace vdbdither::test
