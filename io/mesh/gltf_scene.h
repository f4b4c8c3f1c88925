#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include <openvdb/math/Mat4.h>

#include "io/mesh/gltf_json.h"

namespace vdbdither {

/// A mesh as a node of a scene places it.
struct GltfInstance {
  std::uint64_t mesh = 0;
  std::string name;         ///< of the node or of its mesh; empty where neither has one
  openvdb::Mat4d to_world;  ///< for column vectors, in the units of the file
  std::optional<std::uint64_t> skin;
};

struct GltfScene {
  std::vector<GltfInstance> instances;  ///< a node before its children, in the order of the file
  std::map<std::uint64_t, openvdb::Mat4d> to_world;  ///< of every node that is reached
  std::uint64_t hidden = 0;  ///< meshes that KHR_node_visibility does not show
};

/// Walks through the default scene, through all scenes where none is the default, and through all
/// nodes where there are no scenes. Refuses nodes that are reached twice, such as cycles, and trees
/// of more than 64 levels, and nodes that EXT_mesh_gpu_instancing repeats.
GltfScene readGltfScene(const GltfValue& root);

}  // namespace vdbdither
