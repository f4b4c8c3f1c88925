#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

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

/// Writes the same mesh compressed by Draco. It is kept in memory: Draco encodes it as a whole.
class CompressedGlbEncoder : public MeshEncoder {
 public:
  CompressedGlbEncoder(const std::filesystem::path& path, const VertexExtras& extras,
                       double precision_mm);

  void vertex(const MeshVertex& vertex) override;
  void triangle(const Mesh::Triangle& triangle) override { encoding_.triangle(triangle); }

 protected:
  void finish(std::uint64_t vertices, std::uint64_t triangles) override;

 private:
  VertexExtras extras_;
  DracoEncoding encoding_;
  std::vector<openvdb::Vec3s> positions_;
  std::vector<std::array<std::uint16_t, 4>> colours_;
  std::vector<float> qualities_;
};

}  // namespace vdbdither
