#pragma once

#include <string>
#include <string_view>

#include "io/mesh/mesh_file.h"
#include "vdbdither/model/mesh.h"

namespace vdbdither {

/// Whether every side of a triangle is met by one in the opposite direction, between the same
/// positions; vertices need not be shared. Errs once in 2⁶⁴ meshes.
bool isClosed(const Mesh& mesh);

/// Whether `bytes` are white space and zeros alone.
bool isBlank(std::string_view bytes);

/// Decides on bytes of which no triangle was made. They usually mean that the records before them
/// were misread, which a closed mesh and blank bytes rule out: then a warning says that the bytes
/// are ignored, otherwise the file is refused. Does nothing where there are none.
///
/// @param rest   the bytes
/// @param after  what they follow: "the last triangle"
void judgeUnread(const MeshFile& file, const Mesh& mesh, std::string_view rest,
                 const std::string& after);

}  // namespace vdbdither
