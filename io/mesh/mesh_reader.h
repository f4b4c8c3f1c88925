#pragma once

#include <filesystem>
#include <functional>
#include <string>

#include "io/mesh/mesh_file.h"
#include "vdbdither/engine/option_groups.h"
#include "vdbdither/model/mesh.h"

namespace vdbdither {

/// Reads a triangle mesh from a file of any of the `meshFormats`. The content decides which it is,
/// and the name only where the content leaves it open.
///
/// Guarantees: at least one triangle, finite positions, indices in range, no vertex without a
/// triangle, vertices in the order of their first appearance in the file. Corners of an STL at
/// exactly the same position (−0 equals +0) share one vertex; OBJ and PLY keep the vertices of the
/// file. Polygons come back as triangles that cover them, also when they are concave.
///
/// @param path     a regular file; one that is written to while it is read is refused
/// @param warn     receives a line for each irregularity that was read anyway; may be empty
/// @param colours  with `read`, `Mesh::appearance` holds the colours of the file, if it has any
/// @throws DataError for everything else: what is wrong, on which line or byte, and what to do
Mesh readMesh(const std::filesystem::path& path,
              const std::function<void(const std::string&)>& warn,
              MeshColours colours = MeshColours::skip);

/// The same for a file whose bytes are in memory.
Mesh parseMesh(const MeshFile& file);

/// Refuses --unit for a mesh whose file states the unit of its numbers. Throws UsageError.
void checkUnit(const Mesh& mesh, const std::filesystem::path& path,
               const MeshPlacementOptions& placement);

}  // namespace vdbdither
