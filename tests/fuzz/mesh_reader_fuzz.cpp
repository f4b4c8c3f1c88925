// Feeds the mesh parsers with whatever a fuzzer can think of: they return a sound mesh or refuse in
// one line. Build with VDBDITHER_FUZZ=ON by clang, then run it on a folder of small meshes.

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

static void parseAndCheck(std::string_view bytes) {
  try {
    // The name settles what the content leaves open: a binary STL of a wrong size.
    const Mesh mesh = parseMesh(MeshFile(
        "fuzz.stl", bytes, [](const std::string& warning) { require(isOneLine(warning)); }));
    require(!mesh.triangles.empty());
    for (const openvdb::Vec3d& vertex : mesh.vertices) require(isFinite(vertex));
    for (const Mesh::Triangle& triangle : mesh.triangles) {
      for (const std::uint32_t vertex : triangle) require(vertex < mesh.vertices.size());
    }
  } catch (const DataError& error) {
    require(isOneLine(error.what()));
  }
}

}  // namespace vdbdither

// NOLINTNEXTLINE(readability-identifier-naming): the fuzzer calls it so
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  vdbdither::parseAndCheck({reinterpret_cast<const char*>(data), size});
  return 0;
}
