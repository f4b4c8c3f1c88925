#include "tests/support/mesh_files.h"

#include <algorithm>
#include <array>
#include <bit>
#include <charconv>
#include <cstdint>
#include <cstring>

namespace vdbdither::test {

namespace {

/// Returns the shortest text that reads back as the same number.
std::string digits(double value) {
  std::array<char, 32> buffer{};
  return {buffer.begin(), std::to_chars(buffer.begin(), buffer.end(), value).ptr};
}

std::string words(const openvdb::Vec3d& position) {
  return digits(position.x()) + " " + digits(position.y()) + " " + digits(position.z());
}

template <class T>
void append(std::string& bytes, T value, bool big_endian = false) {
  std::array<char, sizeof(T)> buffer{};
  std::memcpy(buffer.data(), &value, sizeof(T));
  if (big_endian) std::reverse(buffer.begin(), buffer.end());
  bytes.append(buffer.begin(), buffer.end());
}

}  // namespace

std::string binaryStl(const Mesh& mesh, std::string_view header) {
  std::string bytes(header);
  bytes.resize(80, ' ');
  append(bytes, static_cast<std::uint32_t>(mesh.triangles.size()));
  for (const Mesh::Triangle& triangle : mesh.triangles) {
    bytes.append(12, '\0');
    for (const std::uint32_t vertex : triangle) {
      for (int axis = 0; axis < 3; ++axis) {
        append(bytes, static_cast<float>(mesh.vertices[vertex][axis]));
      }
    }
    bytes.append(2, '\0');
  }
  return bytes;
}

std::string asciiStl(const Mesh& mesh, std::string_view newline) {
  std::string text;
  const auto add_line = [&](std::string_view line) { text.append(line).append(newline); };
  add_line("solid part");
  for (const Mesh::Triangle& triangle : mesh.triangles) {
    add_line("  facet normal 0.000000e+00 0.000000e+00 0.000000e+00");
    add_line("    outer loop");
    for (const std::uint32_t vertex : triangle) {
      add_line("      vertex " + words(mesh.vertices[vertex]));
    }
    add_line("    endloop");
    add_line("  endfacet");
  }
  add_line("endsolid part");
  return text;
}

std::string objText(const Mesh& mesh, std::string_view newline) {
  std::string text("# a part");
  text += newline;
  for (const openvdb::Vec3d& vertex : mesh.vertices) {
    text.append("v ").append(words(vertex)).append(newline);
  }
  for (const Mesh::Triangle& triangle : mesh.triangles) {
    text += "f";
    for (const std::uint32_t vertex : triangle) text.append(" ").append(std::to_string(vertex + 1));
    text += newline;
  }
  return text;
}

std::string plyFile(const Mesh& mesh, PlyEncoding encoding, std::string_view coordinate,
                    std::string_view index) {
  constexpr std::array names{"ascii", "binary_little_endian", "binary_big_endian"};
  std::string bytes = "ply\nformat " + std::string(names[static_cast<std::size_t>(encoding)]) +
                      " 1.0\ncomment a part\nelement vertex " +
                      std::to_string(mesh.vertices.size()) + "\n";
  for (const char* axis : {"x", "y", "z"}) {
    bytes += "property " + std::string(coordinate) + " " + axis + "\n";
  }
  bytes += "element face " + std::to_string(mesh.triangles.size()) + "\nproperty list uchar " +
           std::string(index) + " vertex_indices\nend_header\n";
  if (encoding == PlyEncoding::kAscii) {
    for (const openvdb::Vec3d& vertex : mesh.vertices) bytes += words(vertex) + "\n";
    for (const auto& [a, b, c] : mesh.triangles) {
      bytes += "3 " + std::to_string(a) + " " + std::to_string(b) + " " + std::to_string(c) + "\n";
    }
    return bytes;
  }
  const bool big_endian = encoding == PlyEncoding::kBigEndian;
  for (const openvdb::Vec3d& vertex : mesh.vertices) {
    for (int axis = 0; axis < 3; ++axis) {
      if (coordinate == "double") {
        append(bytes, vertex[axis], big_endian);
      } else {
        append(bytes, static_cast<float>(vertex[axis]), big_endian);
      }
    }
  }
  for (const Mesh::Triangle& triangle : mesh.triangles) {
    bytes += '\3';
    for (const std::uint32_t vertex : triangle) {
      if (index == "uint16") {
        append(bytes, static_cast<std::uint16_t>(vertex), big_endian);
      } else {
        append(bytes, vertex, big_endian);
      }
    }
  }
  return bytes;
}

std::vector<const MeshFormat*> writtenMeshFormats() {
  std::vector<const MeshFormat*> formats;
  for (const MeshFormat* format : meshFormats()) {
    if (format->write != nullptr) formats.push_back(format);
  }
  return formats;
}

}  // namespace vdbdither::test
