// "3MF Core Specification" 1.3.0, sections 3.4 and 4.2, 3MF Consortium.

#include "io/mesh/threemf_build.h"

#include <algorithm>
#include <limits>

#include "vdbdither/model/interrupt.h"

namespace vdbdither {

namespace {

constexpr int deepest_components = 32;
constexpr std::uint64_t most_uses = std::uint64_t{1} << 18;
/// Meshes of more triangles are not made, nor those that components multiply to more than that many
/// times the triangles of the file, beyond a size that is always made.
constexpr std::uint64_t most_placed = 200'000'000;
constexpr std::uint64_t always_placed = 4'000'000;
constexpr std::uint64_t most_multiplied = 64;

/// A sum of counts that a file can drive beyond any number.
std::uint64_t cappedSum(std::uint64_t a, std::uint64_t b) {
  constexpr std::uint64_t cap = std::uint64_t{1} << 40;
  return std::min(cap, a + b);
}

}  // namespace

ThreemfBuild::ThreemfBuild(
    const MeshFile& file, std::vector<ThreemfPart>& parts,
    std::function<std::size_t(std::size_t part, const std::string& path)> part_of)
    : file_(file), parts_(parts), part_of_(std::move(part_of)) {}

void ThreemfBuild::Counts::add(const Counts& other) {
  height = std::max(height, other.height + 1);
  nodes = cappedSum(nodes, other.nodes);
  triangles = cappedSum(triangles, other.triangles);
  vertices = cappedSum(vertices, other.vertices);
}

ThreemfObject& ThreemfBuild::objectOf(const Key& key) const {
  return parts_[key.first].objects[key.second];
}

ThreemfBuild::Key ThreemfBuild::keyOf(std::size_t part, const ThreemfUse& use) const {
  const std::size_t target = part_of_(part, use.path);
  const auto found = parts_[target].object_of_id.find(use.object);
  if (found == parts_[target].object_of_id.end()) {
    file_.refuse("places the object " + std::to_string(use.object) + " of " +
                 inQuotes(parts_[target].name) + ", which there is not; export it again");
  }
  return {target, found->second};
}

/// What is printed: the items of the build, or all objects that no other one consists of.
std::vector<ThreemfUse> ThreemfBuild::items() const {
  const ThreemfPart& root = parts_.front();
  if (root.left_out > 0) {
    file_.warn("leaves out " + std::to_string(root.left_out) +
               (root.left_out == 1 ? " item that is" : " items that are") +
               " marked as not printable");
  }
  if (!root.items.empty() || root.left_out > 0) return root.items;
  std::vector<bool> is_component(root.objects.size());
  for (const ThreemfObject& object : root.objects) {
    for (const ThreemfUse& use : object.components) {
      const Key key = keyOf(0, use);
      if (key.first == 0) is_component[key.second] = true;
    }
  }
  std::vector<ThreemfUse> all;
  for (std::size_t i = 0; i < root.objects.size(); ++i) {
    if (!is_component[i]) all.push_back({"", root.objects[i].id, {}});
  }
  file_.warn("says not what is to be printed (its build has no items); takes all objects");
  return all;
}

ThreemfBuild::Counts ThreemfBuild::count(const Key& key, int depth) {
  const ThreemfObject& object = objectOf(key);
  const std::string name = "the object " + std::to_string(object.id);
  const auto refuse_depth = [&] {
    file_.refuse(name + " has components within components, deeper than " +
                 std::to_string(deepest_components) + "; export it with fewer levels");
  };
  const auto known = counts_.find(key);
  if (known != counts_.end() && known->second.is_open)
    file_.refuse(name + " is a component of itself; export it again");
  if (known != counts_.end()) return known->second;
  if (depth > deepest_components) refuse_depth();
  counts_.emplace(key, Counts{});
  Counts counts;
  counts.triangles = object.is_printed ? object.triangles.size() : 0;
  counts.vertices = object.is_printed ? object.vertices.size() : 0;
  for (const ThreemfUse& use : object.components)
    counts.add(count(keyOf(key.first, use), depth + 1));
  if (counts.height > deepest_components) refuse_depth();
  counts.is_open = false;
  counts_[key] = counts;
  return counts;
}

void ThreemfBuild::checkCounts(const Counts& all) const {
  if (all.nodes > most_uses) {
    file_.refuse("places more than " + std::to_string(most_uses) +
                 " objects; print fewer at a time");
  }
  std::uint64_t stored = 0;
  for (const ThreemfPart& part : parts_) {
    for (const ThreemfObject& object : part.objects)
      stored += object.vertices.size() + object.triangles.size();
  }
  const std::uint64_t most = std::clamp(most_multiplied * stored, always_placed, most_placed);
  if (std::max(all.triangles, all.vertices) > most) {
    file_.refuse("its components make more than " + std::to_string(most) +
                 " triangles or vertices; print fewer at a time");
  }
}

Mesh ThreemfBuild::make(const Placed& placed) {
  const std::vector<ThreemfUse> uses = items();
  std::vector<Key> keys;
  Counts all;
  for (const ThreemfUse& use : uses) {
    keys.push_back(keyOf(0, use));
    all.add(count(keys.back(), 1));
  }
  checkCounts(all);
  is_only_use_ = all.nodes == 2;
  if (!is_only_use_) {
    mesh_.vertices.reserve(all.vertices);
    mesh_.triangles.reserve(all.triangles);
  }
  for (std::size_t i = 0; i < uses.size(); ++i) place(keys[i], uses[i].transform, "", placed);
  if (left_out_ > 0) {
    file_.warn("leaves out " + std::to_string(left_out_) +
               (left_out_ == 1 ? " object that is" : " objects that are") +
               " no model: supports and others");
  }
  if (mesh_.parts.size() < 2) mesh_.parts.clear();
  return std::move(mesh_);
}

void ThreemfBuild::place(const Key& key, const ThreemfTransform& transform, const std::string& name,
                         const Placed& placed) {
  throwIfInterrupted();
  ThreemfObject& object = objectOf(key);
  if (!object.is_printed) {
    ++left_out_;
    return;
  }
  const std::string& nearest = object.name.empty() ? name : object.name;
  if (!object.triangles.empty()) {
    mesh_.parts.push_back(
        {names_.unique(nearest.empty() ? "object " + std::to_string(object.id) : nearest),
         static_cast<std::uint32_t>(mesh_.triangles.size())});
    const bool is_turned = transform.determinant() < 0;
    if (placed) placed(parts_[key.first], object, is_turned);
    append(object, transform, is_turned);
  }
  for (const ThreemfUse& use : object.components)
    place(keyOf(key.first, use), use.transform.then(transform), nearest, placed);
}

void ThreemfBuild::append(ThreemfObject& object, const ThreemfTransform& transform,
                          bool is_turned) {
  const std::size_t first_vertex = mesh_.vertices.size();
  const std::size_t first_triangle = mesh_.triangles.size();
  if (is_only_use_) {
    mesh_.vertices = std::move(object.vertices);
    mesh_.triangles = std::move(object.triangles);
  } else {
    mesh_.vertices.insert(mesh_.vertices.end(), object.vertices.begin(), object.vertices.end());
    mesh_.triangles.insert(mesh_.triangles.end(), object.triangles.begin(), object.triangles.end());
  }
  if (!transform.isIdentity()) {
    for (std::size_t i = first_vertex; i < mesh_.vertices.size(); ++i) {
      mesh_.vertices[i] = transform.of(mesh_.vertices[i]);
      if (!isFinite(mesh_.vertices[i])) {
        file_.refuse("the object " + std::to_string(object.id) +
                     " is placed where coordinates are not finite; export it again");
      }
    }
  }
  const auto offset = static_cast<std::uint32_t>(first_vertex);
  for (std::size_t t = first_triangle; t < mesh_.triangles.size(); ++t) {
    Mesh::Triangle& triangle = mesh_.triangles[t];
    for (std::uint32_t& vertex : triangle) vertex += offset;
    if (is_turned) std::swap(triangle[1], triangle[2]);
  }
}

}  // namespace vdbdither
