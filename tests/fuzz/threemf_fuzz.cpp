// Feeds the reader of 3MF with model parts, and with whole archives, that a fuzzer thinks of: it
// returns a sound mesh with a sound appearance or refuses in one line. A seed is the text of a
// model part, or a small 3MF file.

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <string>
#include <string_view>
#include <zlib.h>

#include "io/mesh/mesh_reader.h"
#include "vdbdither/model/errors.h"

namespace vdbdither {

static void require(bool condition) {
  if (!condition) std::abort();
}

static bool isOneLine(std::string_view message) {
  return message.find_first_of("\r\n") == std::string_view::npos;
}

/// A zip archive of one file, stored: APPNOTE.TXT of PKWARE, 4.3.
static std::string archiveOf(std::string_view name, std::string_view content) {
  const auto number = [](std::uint64_t value, int bytes) {
    std::string text;
    for (; bytes > 0; --bytes, value >>= 8) text += static_cast<char>(value & 0xFF);
    return text;
  };
  const auto checksum =
      ::crc32(0, reinterpret_cast<const Bytef*>(content.data()), static_cast<uInt>(content.size()));
  // Version, flags, method, time and date; checksum and sizes; the length of the name, extra bytes.
  const std::string shared = number(20, 2) + number(0, 8) + number(checksum, 4) +
                             number(content.size(), 4) + number(content.size(), 4) +
                             number(name.size(), 2) + number(0, 2);
  const std::string begin = "PK\x03\x04" + shared + std::string(name) + std::string(content);
  const std::string directory =
      "PK\x01\x02" + number(20, 2) + shared + number(0, 14) + std::string(name);
  return begin + directory + "PK\x05\x06" + number(0, 4) + number(1, 2) + number(1, 2) +
         number(directory.size(), 4) + number(begin.size(), 4) + number(0, 2);
}

static void check(const Appearance& appearance, std::size_t triangles) {
  require(appearance.material.size() == triangles);
  for (const std::uint32_t material : appearance.material)
    require(material < appearance.materials.size());
  for (const SurfaceMaterial& material : appearance.materials)
    require(material.texture == SurfaceMaterial::no_texture ||
            material.texture < appearance.textures.size());
  require(appearance.coordinates.empty() || appearance.coordinates.size() == triangles);
  for (const Appearance::Coordinates& corners : appearance.coordinates) {
    for (const openvdb::Vec2f& at : corners)
      require(std::isfinite(at.x()) && std::isfinite(at.y()));
  }
  require(appearance.colours.empty() || appearance.colours.size() == triangles);
}

static void readAndCheck(std::string_view bytes) {
  try {
    const Mesh mesh = parseMesh(MeshFile(
        "fuzz.3mf", bytes, [](const std::string& warning) { require(isOneLine(warning)); },
        MeshColours::read));
    require(!mesh.triangles.empty());
    for (const openvdb::Vec3d& vertex : mesh.vertices) require(isFinite(vertex));
    for (const Mesh::Triangle& triangle : mesh.triangles) {
      for (const std::uint32_t vertex : triangle) require(vertex < mesh.vertices.size());
    }
    for (const MeshPart& part : mesh.parts) {
      require(part.begin < mesh.triangles.size());
      require(isOneLine(part.name));
    }
    if (mesh.appearance) check(*mesh.appearance, mesh.triangles.size());
  } catch (const DataError& error) {
    require(isOneLine(error.what()));
  }
}

}  // namespace vdbdither

// NOLINTNEXTLINE(readability-identifier-naming): the fuzzer calls it so
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view bytes(reinterpret_cast<const char*>(data), size);
  if (bytes.starts_with("PK")) {
    vdbdither::readAndCheck(bytes);
  } else {
    vdbdither::readAndCheck(vdbdither::archiveOf("3D/3dmodel.model", bytes));
  }
  return 0;
}
