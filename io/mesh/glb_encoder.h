#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

#include <openvdb/Types.h>

#include "io/mesh/draco_encoding.h"
#include "io/mesh/glb_document.h"
#include "io/mesh/mesh_encoder.h"

namespace vdbdither {

/// Writes a GLB with one node. Its positions are mm, as they come, and the node scales them to
/// metres: so they read back exactly.
class GlbEncoder : public IndexedMeshEncoder {
 public:
  GlbEncoder(const std::filesystem::path& path, const VertexExtras& extras);

  void vertex(const MeshVertex& vertex) override;
  void triangle(const Mesh::Triangle& triangle) override;

 protected:
  void finish(std::uint64_t vertices, std::uint64_t triangles) override;

 private:
  /// Of the same length for every count.
  [[nodiscard]] std::string beginning() const;
  void count(std::uint64_t bytes);

  VertexExtras extras_;
  GlbMesh mesh_;
  std::uint64_t json_bytes_;
  std::uint64_t bytes_;
};

/// Writes the same mesh compressed by Draco.
class CompressedGlbEncoder : public DracoMeshEncoder {
 public:
  using DracoMeshEncoder::DracoMeshEncoder;

 protected:
  void finish(std::uint64_t vertices, std::uint64_t triangles) override;
};

}  // namespace vdbdither
