#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <vector>

#include <openvdb/math/Mat4.h>

#include "io/mesh/gltf_accessors.h"
#include "io/mesh/gltf_json.h"
#include "io/mesh/gltf_primitive.h"

namespace vdbdither {

/// The bones of a mesh in the pose that a file stores. The node of the mesh does not matter.
class GltfSkin {
 public:
  /// @param to_world  of every node of the scene. Throws DataError for joints that are no nodes of
  ///                  it.
  GltfSkin(const GltfValue& json, const std::map<std::uint64_t, openvdb::Mat4d>& to_world,
           GltfAccessors& accessors);

  /// Returns the map of a vertex to the world. Throws DataError for joints that the skin does not
  /// have.
  [[nodiscard]] openvdb::Mat4d mapOf(const std::array<GltfBone, 4>& bones) const;

 private:
  GltfValue json_;
  std::vector<openvdb::Mat4d> joints_;  ///< of a vertex that one joint alone moves, to the world
};

}  // namespace vdbdither
