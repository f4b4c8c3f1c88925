#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <utility>
#include <vector>

#include <openvdb/Types.h>

#include "io/mesh/mesh_file.h"
#include "vdbdither/model/mesh.h"

namespace vdbdither {

/// Gives corners at the same position one vertex, in the order of first appearance. An
/// open-addressing table of (hash, vertex), at most half full. Corners are looked up in batches, so
/// that the memory they need is on its way before it is touched.
class VertexWelder {
 public:
  explicit VertexWelder(const MeshFile& file) : file_(file), slots_(1024) {}

  void reserve(std::size_t triangles) { mesh_.triangles.reserve(triangles); }

  void addTriangle(const std::array<openvdb::Vec3d, 3>& corners) {
    for (const openvdb::Vec3d& corner : corners) {
      batch_[batched_] = corner + openvdb::Vec3d(0.0);  // −0 becomes +0
      hashes_[batched_] = hashOf(batch_[batched_]);
      ++batched_;
    }
    if (batched_ == batch_.size()) weldBatch();
  }

  Mesh take() {
    weldBatch();
    return std::move(mesh_);
  }

 private:
  static constexpr auto none = std::numeric_limits<std::uint32_t>::max();
  struct Slot {
    std::uint32_t hash = 0;
    std::uint32_t vertex = none;
  };

  static std::uint32_t hashOf(const openvdb::Vec3d& position) {
    std::uint64_t hash = std::bit_cast<std::uint64_t>(position.x()) * 0x9E3779B97F4A7C15 +
                         std::bit_cast<std::uint64_t>(position.y()) * 0xC2B2AE3D27D4EB4F +
                         std::bit_cast<std::uint64_t>(position.z()) * 0x165667B19E3779F9;
    hash ^= hash >> 32;
    hash *= 0xD6E8FEB86659FD93;
    return static_cast<std::uint32_t>(hash >> 32);
  }

  void weldBatch() {
    for (std::size_t i = 0; i < batched_; ++i) __builtin_prefetch(&slots_[home(hashes_[i])]);
    for (std::size_t i = 0; i < batched_; ++i) {
      const Slot& slot = slots_[home(hashes_[i])];
      if (slot.vertex != none) __builtin_prefetch(&mesh_.vertices[slot.vertex]);
    }
    for (std::size_t i = 0; i < batched_; i += 3) {
      const std::uint32_t a = vertexAt(i);
      const std::uint32_t b = vertexAt(i + 1);
      mesh_.triangles.push_back({a, b, vertexAt(i + 2)});
    }
    batched_ = 0;
  }

  /// The vertex of corner `i` of the batch.
  std::uint32_t vertexAt(std::size_t i) {
    std::size_t at = home(hashes_[i]);
    for (; slots_[at].vertex != none; at = next(at)) {
      if (slots_[at].hash == hashes_[i] && mesh_.vertices[slots_[at].vertex] == batch_[i]) {
        return slots_[at].vertex;
      }
    }
    if (mesh_.vertices.size() == none) {
      file_.refuse("more than 4294967295 vertices; split the part");
    }
    const auto vertex = static_cast<std::uint32_t>(mesh_.vertices.size());
    slots_[at] = {hashes_[i], vertex};
    mesh_.vertices.push_back(batch_[i]);
    if (mesh_.vertices.size() * 2 > slots_.size()) grow();
    return vertex;
  }

  void grow() {
    std::vector<Slot> before(slots_.size() * 2);
    slots_.swap(before);
    for (const Slot& slot : before) {
      if (slot.vertex == none) continue;
      std::size_t at = home(slot.hash);
      while (slots_[at].vertex != none) at = next(at);
      slots_[at] = slot;
    }
  }

  /// Where the search for a hash starts, and how it goes on.
  [[nodiscard]] std::size_t home(std::uint32_t hash) const { return hash & (slots_.size() - 1); }
  [[nodiscard]] std::size_t next(std::size_t at) const { return (at + 1) & (slots_.size() - 1); }

  const MeshFile& file_;
  std::vector<Slot> slots_;
  std::array<openvdb::Vec3d, 96> batch_;
  std::array<std::uint32_t, 96> hashes_;
  std::size_t batched_ = 0;
  Mesh mesh_;
};

}  // namespace vdbdither
