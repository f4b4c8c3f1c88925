// Feeds the mesh parsers with whatever a fuzzer can think of: they return a sound mesh or refuse in
// one line. The preset fuzz builds it; run it on a folder of small meshes.

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <string_view>

#include "io/mesh/mesh_reader.h"
#include "vdbdither/model/errors.h"

namespace vdbdither {

static void require(bool condition) {
  if (!condition) std::abort();
}

static bool isOneLine(std::string_view message) {
  return message.find_first_of("\r\n") == std::string_view::npos;
}

static void checkShare(float value) { require(value >= 0 && value <= 1); }

static void checkAppearance(const Mesh& mesh) {
  if (mesh.appearance == nullptr) return;
  const Appearance& appearance = *mesh.appearance;
  const std::size_t triangles = mesh.triangles.size();
  require(appearance.material.size() == triangles);
  require(appearance.coordinates.empty() || appearance.coordinates.size() == triangles);
  require(appearance.colours.empty() || appearance.colours.size() == triangles);
  for (const std::uint32_t material : appearance.material)
    require(material < appearance.materials.size());
  for (const SurfaceMaterial& material : appearance.materials) {
    for (int i = 0; i < 4; ++i) checkShare(material.colour[i]);
    require(material.texture == SurfaceMaterial::no_texture ||
            material.texture < appearance.textures.size());
  }
  for (const Appearance::Colours& corners : appearance.colours) {
    for (const openvdb::Vec4f& colour : corners) {
      for (int i = 0; i < 4; ++i) checkShare(colour[i]);
    }
  }
  for (const Appearance::Coordinates& corners : appearance.coordinates) {
    for (const openvdb::Vec2f& corner : corners)
      require(std::isfinite(corner.x()) && std::isfinite(corner.y()));
  }
}

static void parseAndCheck(std::string_view bytes, MeshColours colours) {
  try {
    // The ending settles what the content leaves open: a binary STL of a wrong size. No file of
    // another name is ever found in this folder.
    const Mesh mesh = parseMesh(MeshFile(
        "no such folder/fuzz.stl", bytes,
        [](const std::string& warning) { require(isOneLine(warning)); }, colours));
    require(!mesh.triangles.empty());
    for (const openvdb::Vec3d& vertex : mesh.vertices) require(isFinite(vertex));
    for (const Mesh::Triangle& triangle : mesh.triangles) {
      for (const std::uint32_t vertex : triangle) require(vertex < mesh.vertices.size());
    }
    checkAppearance(mesh);
  } catch (const DataError& error) {
    require(isOneLine(error.what()));
  }
}

}  // namespace vdbdither

// NOLINTNEXTLINE(readability-identifier-naming): the fuzzer calls it so
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view bytes(reinterpret_cast<const char*>(data), size);
  vdbdither::parseAndCheck(bytes, vdbdither::MeshColours::skip);
  vdbdither::parseAndCheck(bytes, vdbdither::MeshColours::read);
  return 0;
}
