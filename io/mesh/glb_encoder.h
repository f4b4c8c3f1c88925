#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

#include <openvdb/Types.h>

#include "io/mesh/mesh_encoder.h"

namespace vdbdither {

/// Writes a GLB with one node. Its positions are mm, as they come, and the node scales them to
/// metres: so they read back exactly. Colours are COLOR_0, linear, and the scalar is _QUALITY.
class GlbEncoder : public IndexedMeshEncoder {
 public:
  GlbEncoder(const std::filesystem::path& path, const VertexExtras& extras);

  void vertex(const MeshVertex& vertex) override;
  void triangle(const Mesh::Triangle& triangle) override;

 protected:
  void finish(std::uint64_t vertices, std::uint64_t triangles) override;

 private:
  [[nodiscard]] std::uint64_t stride() const;
  [[nodiscard]] std::string json(std::uint64_t vertices, std::uint64_t triangles) const;
  /// The header and the JSON chunk, of the same length for every count, and the header of the
  /// binary chunk.
  [[nodiscard]] std::string beginning(std::uint64_t vertices, std::uint64_t triangles) const;
  /// Refuses a file whose length cannot be told in 32 bits.
  void count(std::uint64_t bytes);

  VertexExtras extras_;
  std::uint64_t json_bytes_;
  std::uint64_t bytes_;
  openvdb::Vec3s low_;
  openvdb::Vec3s high_;
};

}  // namespace vdbdither
