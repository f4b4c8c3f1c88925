#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include <openvdb/Types.h>

namespace vdbdither {

/// An indexed triangle mesh. Reading makes no promise about it: triangles may be degenerate,
/// wrongly oriented or open, and vertices need not be shared.
struct Mesh {
  using Triangle = std::array<std::uint32_t, 3>;

  std::vector<openvdb::Vec3d>
      vertices;                     ///< finite positions; in mm once mesh2sdf has placed the part
  std::vector<Triangle> triangles;  ///< indices into `vertices`, all in range
};

}  // namespace vdbdither
