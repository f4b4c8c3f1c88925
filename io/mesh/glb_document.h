#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <string>

#include <nlohmann/json_fwd.hpp>
#include <openvdb/Types.h>

#include "io/mesh/mesh_encoder.h"

namespace vdbdither {

/// The mesh of a GLB file: its size and the box of its positions.
struct GlbMesh {
  std::uint64_t vertices = 0;
  std::uint64_t triangles = 0;
  openvdb::Vec3s low{std::numeric_limits<float>::max()};
  openvdb::Vec3s high{std::numeric_limits<float>::lowest()};

  void take(const openvdb::Vec3s& position) {
    low = openvdb::math::minComponent(low, position);
    high = openvdb::math::maxComponent(high, position);
  }
};

/// What a vertex takes, in bytes.
std::uint64_t glbVertexBytes(const VertexExtras& extras);

/// Linear light, as shares of 65535, and full opacity.
std::array<std::uint16_t, 4> glbColour(const std::array<std::uint8_t, 3>& srgb);

/// Returns the JSON of a file with one mesh in one node. The positions are mm, and the node scales
/// them to metres. The buffer has the vertices, then the indices of the triangles. Colours are
/// COLOR_0, linear, and the scalar is _QUALITY.
nlohmann::ordered_json glbDocument(const VertexExtras& extras, const GlbMesh& mesh);

/// Returns the header, the JSON chunk and the header of the binary chunk.
/// @param json        the text of a document
/// @param json_bytes  the length of the JSON chunk, a multiple of four; blanks fill it
std::string glbBeginning(const std::string& json, std::uint64_t json_bytes,
                         std::uint64_t binary_bytes);

/// Refuses a file whose length cannot be told in 32 bits.
void checkGlbBytes(std::uint64_t bytes);

}  // namespace vdbdither
