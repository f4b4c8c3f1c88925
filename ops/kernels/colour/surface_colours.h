#pragma once

// The colour family: kernels that bring the colours of surfaces onto the lattice.

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include <openvdb/Types.h>

#include "ops/kernels/colour/texture_filter.h"
#include "vdbdither/model/mesh.h"

namespace vdbdither {

/// The colours of the triangles of some meshes, which are counted through all of them.
///
/// Colours of corners are interpolated between the corners. Textures are averaged over the box of a
/// voxel, seen on the surface, so that texels that are smaller than voxels leave no pattern.
class SurfaceColours {
 public:
  /// Positions in mm, at their places. Triangles of meshes without an appearance are white.
  SurfaceColours(std::span<const Mesh> meshes, const openvdb::Vec3d& pitch_mm);

  /// Returns linear red, green, blue and the opacity, 0 … 1, of the point of a triangle that is
  /// nearest to `p_mm`.
  [[nodiscard]] openvdb::Vec4f at(std::uint32_t triangle, const openvdb::Vec3d& p_mm) const;

  /// Whether some surface may be less than opaque.
  [[nodiscard]] bool hasOpacity() const { return has_opacity_; }
  [[nodiscard]] double memoryBytes() const;

 private:
  struct Source {
    std::shared_ptr<const Appearance> appearance;  ///< null: white
    std::uint32_t first = 0;                       ///< of its triangles
    std::vector<FilteredTexture> textures;
  };

  void add(const Mesh& mesh);
  [[nodiscard]] const Source& sourceOf(std::uint32_t triangle) const;
  [[nodiscard]] TextureFootprint footprintOf(std::uint32_t triangle,
                                             const openvdb::Vec3d& pitch_mm) const;

  std::vector<openvdb::Vec3d> vertices_;
  std::vector<Mesh::Triangle> triangles_;
  std::vector<Source> sources_;
  std::vector<TextureFootprint> footprints_;  ///< by triangle; empty without textures
  bool has_opacity_ = false;
};

}  // namespace vdbdither
