#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "io/mesh/mesh_reader.h"
#include "tests/fuzz/require.h"
#include "vdbdither/model/errors.h"

namespace vdbdither {

inline void requireShares(const openvdb::Vec4f& colour) {
  for (int i = 0; i < 4; ++i) require(colour[i] >= 0 && colour[i] <= 1);
}

inline void requireSound(const Appearance& appearance, std::size_t triangles) {
  require(appearance.material.size() == triangles);
  require(appearance.coordinates.empty() || appearance.coordinates.size() == triangles);
  require(appearance.colours.empty() || appearance.colours.size() == triangles);
  for (const std::uint32_t material : appearance.material)
    require(material < appearance.materials.size());
  for (const SurfaceMaterial& material : appearance.materials) {
    requireShares(material.colour);
    require(material.texture == SurfaceMaterial::no_texture ||
            material.texture < appearance.textures.size());
  }
  for (const Appearance::Colours& corners : appearance.colours) {
    for (const openvdb::Vec4f& colour : corners) requireShares(colour);
  }
  for (const Appearance::Coordinates& corners : appearance.coordinates) {
    for (const openvdb::Vec2f& at : corners)
      require(std::isfinite(at.x()) && std::isfinite(at.y()));
  }
}

/// Requires that `bytes` are read as a sound mesh, and returns it, or refused in one line.
/// @param name  of the file, in a folder that does not exist
inline Mesh requireSoundMesh(const char* name, std::string_view bytes, MeshColours colours) {
  try {
    const Mesh mesh = parseMesh(MeshFile(
        name, bytes, [](const std::string& warning) { require(isOneLine(warning)); }, colours));
    require(!mesh.triangles.empty());
    for (const openvdb::Vec3d& vertex : mesh.vertices) require(isFinite(vertex));
    for (const Mesh::Triangle& triangle : mesh.triangles) {
      for (const std::uint32_t vertex : triangle) require(vertex < mesh.vertices.size());
    }
    for (const MeshPart& part : mesh.parts) require(part.begin < mesh.triangles.size());
    if (mesh.appearance) requireSound(*mesh.appearance, mesh.triangles.size());
    return mesh;
  } catch (const DataError& error) {
    require(isOneLine(error.what()));
    return {};
  }
}

}  // namespace vdbdither
