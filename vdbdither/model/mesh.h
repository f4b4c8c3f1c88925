#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include <openvdb/Types.h>

#include "vdbdither/model/appearance.h"

namespace vdbdither {

/// Triangles of a mesh under one name, from `begin` up to those of the next part.
struct MeshPart {
  std::string name;
  std::uint32_t begin = 0;
};

/// An indexed triangle mesh. Reading makes no promise about it: triangles may be degenerate,
/// wrongly oriented or open, and vertices need not be shared.
struct Mesh {
  using Triangle = std::array<std::uint32_t, 3>;

  std::vector<openvdb::Vec3d>
      vertices;                     ///< finite positions; in mm once mesh2sdf has placed the part
  std::vector<Triangle> triangles;  ///< indices into `vertices`, all in range
  /// In the order of the triangles, where a file names two or more. Only readers set them, and
  /// `partsOf` reads them: meshes made from others have none.
  std::vector<MeshPart> parts{};
  /// Of all triangles; null where the file has no colours or they were not asked for. Only readers
  /// set it.
  std::shared_ptr<const Appearance> appearance{};
  /// Whether the file says what its numbers mean. Then the vertices are mm as they are read.
  bool states_unit = false;
};

}  // namespace vdbdither
