#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "io/mesh/mesh_format.h"
#include "vdbdither/model/mesh.h"

namespace vdbdither::test {

/// Return the bytes of a mesh in each format that is read. Normals are zero.
std::string binaryStl(const Mesh& mesh, std::string_view header = "binary STL");
std::string asciiStl(const Mesh& mesh, std::string_view newline = "\n");
std::string objText(const Mesh& mesh, std::string_view newline = "\n");

enum class PlyEncoding { kAscii, kLittleEndian, kBigEndian };

/// @param coordinate  type of the coordinates, "float" or "double"
/// @param index       type of the indices, "int" or "uint16"
std::string plyFile(const Mesh& mesh, PlyEncoding encoding, std::string_view coordinate = "float",
                    std::string_view index = "int");

/// Returns every registered format that is written as well as read.
std::vector<const MeshFormat*> writtenMeshFormats();

}  // namespace vdbdither::test
