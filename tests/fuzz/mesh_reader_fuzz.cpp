// Feeds the mesh parsers with whatever a fuzzer can think of: they return a sound mesh or refuse in
// one line. Build with VDBDITHER_FUZZ=ON by clang, then run it on a folder of small meshes.

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

static void checkLook(const Mesh& mesh) {
  if (mesh.appearance == nullptr) return;
  const Appearance& look = *mesh.appearance;
  const std::size_t triangles = mesh.triangles.size();
  require(look.material.size() == triangles);
  require(look.coordinates.empty() || look.coordinates.size() == triangles);
  require(look.colours.empty() || look.colours.size() == triangles);
  for (const std::uint32_t material : look.material) require(material < look.materials.size());
  for (const Appearance::Coordinates& corners : look.coordinates) {
    for (const openvdb::Vec2f& at : corners)
      require(std::isfinite(at.x()) && std::isfinite(at.y()));
  }
  for (const Appearance::Colours& corners : look.colours) {
    for (const openvdb::Vec4f& colour : corners) {
      for (int c = 0; c < 4; ++c) require(colour[c] >= 0 && colour[c] <= 1);
    }
  }
}

static void parseAndCheck(std::string_view bytes, MeshColours colours) {
  try {
    // The name settles what the content leaves open: a binary STL of a wrong size. Its folder does
    // not exist, so that no file beside it is found.
    const Mesh mesh = parseMesh(MeshFile(
        "nowhere/fuzz.stl", bytes, [](const std::string& warning) { require(isOneLine(warning)); },
        colours));
    require(!mesh.triangles.empty());
    for (const openvdb::Vec3d& vertex : mesh.vertices) require(isFinite(vertex));
    for (const Mesh::Triangle& triangle : mesh.triangles) {
      for (const std::uint32_t vertex : triangle) require(vertex < mesh.vertices.size());
    }
    checkLook(mesh);
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
