#pragma once

#include <cstdint>
#include <cstring>
#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json.hpp>
#include <openvdb/Types.h>

namespace vdbdither::test {

std::string base64(std::string_view bytes);

/// Frames JSON and binary data as a GLB; the chunks are filled up.
std::string glbOf(std::string json, std::string binary);

/// A glTF file under construction: its JSON, which tests change at will, and its one buffer.
struct GltfFile {
  using Json = nlohmann::json;

  static constexpr int int8 = 5120;
  static constexpr int uint8 = 5121;
  static constexpr int int16 = 5122;
  static constexpr int uint16 = 5123;
  static constexpr int uint32 = 5125;
  static constexpr int float32 = 5126;

  Json json{{"asset", {{"version", "2.0"}}}};
  std::string buffer;

  /// Appends bytes at a multiple of four, and returns the number of their view.
  int addView(std::string_view bytes);

  /// Appends values and returns the number of their accessor.
  /// @param type  "VEC3"
  template <class Value>
  int add(const std::vector<Value>& values, int component_type, const std::string& type) {
    std::string bytes(values.size() * sizeof(Value), '\0');
    std::memcpy(bytes.data(), values.data(), bytes.size());
    const std::size_t components =
        type == "SCALAR" ? 1 : static_cast<std::size_t>(type.back() - '0');
    json["accessors"].push_back({{"bufferView", addView(bytes)},
                                 {"componentType", component_type},
                                 {"type", type},
                                 {"count", values.size() / components}});
    return static_cast<int>(json["accessors"].size()) - 1;
  }

  /// A primitive of the triangle (0 0 0), (1 0 0), (0 1 0), in metres.
  Json triangle();

  /// Adds a mesh, and a node of the default scene that holds it.
  void addMesh(const Json& primitive, const Json& node = Json::object());

  [[nodiscard]] std::string text() const;  ///< with the buffer in a data URI
  [[nodiscard]] std::string glb() const;

  /// A scene of one node with the triangle.
  static GltfFile ofTriangle();
};

}  // namespace vdbdither::test
