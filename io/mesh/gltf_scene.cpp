// glTF 2.0: ISO/IEC 12113:2022, section 3.5.

#include "io/mesh/gltf_scene.h"

#include <array>
#include <set>
#include <string>
#include <utility>

#include <openvdb/math/Mat4.h>

#include "vdbdither/model/interrupt.h"

namespace vdbdither {

using openvdb::Mat4d;

namespace {

/// An array of numbers in a node, or its default.
template <std::size_t size>
std::array<double, size> numbersIn(const GltfValue& json, std::array<double, size> otherwise) {
  if (!json.exists()) return otherwise;
  if (json.size() != size) json.refuse("has not " + std::to_string(size) + " numbers");
  for (std::size_t i = 0; i < size; ++i) otherwise[i] = json.at(i).number(0);
  return otherwise;
}

/// The rotation of a quaternion x, y, z, w, which need not have length 1; none for 0.
std::array<std::array<double, 3>, 3> rotationOf(const std::array<double, 4>& quaternion) {
  const auto [x, y, z, w] = quaternion;
  const double square = x * x + y * y + z * z + w * w;
  const double s = square > 0 ? 2 / square : 0;
  return {{{1 - s * (y * y + z * z), s * (x * y - z * w), s * (x * z + y * w)},
           {s * (x * y + z * w), 1 - s * (x * x + z * z), s * (y * z - x * w)},
           {s * (x * z - y * w), s * (y * z + x * w), 1 - s * (x * x + y * y)}}};
}

Mat4d transformOf(const GltfValue& node) {
  if (node.has("matrix")) {
    const auto m = numbersIn<16>(node["matrix"], {});
    return Mat4d(m[0], m[4], m[8], m[12], m[1], m[5], m[9], m[13], m[2], m[6], m[10], m[14], 0.0,
                 0.0, 0.0, 1.0);
  }
  const auto t = numbersIn<3>(node["translation"], {0, 0, 0});
  const auto r = rotationOf(numbersIn<4>(node["rotation"], {0, 0, 0, 1}));
  const auto s = numbersIn<3>(node["scale"], {1, 1, 1});
  Mat4d matrix = Mat4d::identity();
  for (int row = 0; row < 3; ++row) {
    const auto from = static_cast<std::size_t>(row);
    for (int column = 0; column < 3; ++column) {
      const auto axis = static_cast<std::size_t>(column);
      matrix(row, column) = r[from][axis] * s[axis];
    }
    matrix(row, 3) = t[from];
  }
  return matrix;
}

class Walk {
 public:
  explicit Walk(const GltfValue& root) : root_(root) {}

  GltfScene take() {
    const GltfValue scenes = root_["scenes"];
    if (root_.has("scene")) {
      walk(scenes.at(root_["scene"].count()));
    } else if (scenes.size() > 0) {
      for (std::size_t i = 0; i < scenes.size(); ++i) walk(scenes.at(i));
    } else {
      walkRoots();
    }
    return std::move(scene_);
  }

 private:
  static constexpr int most_levels = 64;

  void walk(const GltfValue& scene) {
    const GltfValue nodes = scene["nodes"];
    for (std::size_t i = 0; i < nodes.size(); ++i) {
      const std::uint64_t node = nodes.at(i).count();
      // Scenes may share roots.
      if (roots_.insert(node).second) visit(node, {Mat4d::identity(), true, 1});
    }
  }

  /// Starts at every node that is no child.
  void walkRoots() {
    const GltfValue nodes = root_["nodes"];
    std::set<std::uint64_t> children;
    for (std::size_t i = 0; i < nodes.size(); ++i) {
      const GltfValue list = nodes.at(i)["children"];
      for (std::size_t c = 0; c < list.size(); ++c) children.insert(list.at(c).count());
    }
    for (std::uint64_t i = 0; i < nodes.size(); ++i) {
      if (children.count(i) == 0) visit(i, {Mat4d::identity(), true, 1});
    }
  }

  /// What a node takes over from its parent.
  struct Parent {
    Mat4d to_world;
    bool is_visible;
    int level;  ///< of the node
  };

  void visit(std::uint64_t index, const Parent& parent) {
    throwIfInterrupted();
    const GltfValue node = root_["nodes"].at(index);
    if (parent.level > most_levels)
      node.refuse("is nested deeper than " + std::to_string(most_levels) + " levels");
    if (!visited_.insert(index).second)
      node.refuse("has more than one parent, or is among its own children");
    const Mat4d to_world = parent.to_world * transformOf(node);
    scene_.to_world.emplace(index, to_world);
    const GltfValue visible = node["extensions"]["KHR_node_visibility"]["visible"];
    const bool is_visible = parent.is_visible && (!visible.exists() || visible.flag());
    if (node.has("mesh")) {
      if (is_visible) {
        addInstance(node, to_world);
      } else {
        ++scene_.hidden;
      }
    }
    const GltfValue children = node["children"];
    for (std::size_t i = 0; i < children.size(); ++i)
      visit(children.at(i).count(), {to_world, is_visible, parent.level + 1});
  }

  void addInstance(const GltfValue& node, const Mat4d& to_world) {
    if (node["extensions"].has("EXT_mesh_gpu_instancing"))
      node.refuse("is repeated by EXT_mesh_gpu_instancing, which is not read");
    const std::uint64_t mesh = node["mesh"].count();
    const std::string_view name =
        node["name"].text().empty() ? root_["meshes"].at(mesh)["name"].text() : node["name"].text();
    GltfInstance instance{mesh, std::string(name), to_world, std::nullopt};
    if (node.has("skin")) instance.skin = node["skin"].count();
    scene_.instances.push_back(std::move(instance));
  }

  GltfValue root_;
  GltfScene scene_;
  std::set<std::uint64_t> roots_;
  std::set<std::uint64_t> visited_;
};

}  // namespace

GltfScene readGltfScene(const GltfValue& root) { return Walk(root).take(); }

}  // namespace vdbdither
