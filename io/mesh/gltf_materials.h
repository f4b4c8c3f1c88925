#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <openvdb/Types.h>

#include "io/image/texture.h"
#include "io/mesh/gltf_buffers.h"
#include "io/mesh/gltf_json.h"
#include "io/mesh/mesh_textures.h"
#include "vdbdither/model/appearance.h"

namespace vdbdither {

/// How texture coordinates of a file become those of a texture: u' = a·u + b·v + c.
struct GltfTextureTransform {
  std::array<double, 3> u{1, 0, 0};
  std::array<double, 3> v{0, 1, 0};

  /// Not finite where the coordinates are too large.
  [[nodiscard]] openvdb::Vec2f of(double from_u, double from_v) const {
    return {static_cast<float>(u[0] * from_u + u[1] * from_v + u[2]),
            static_cast<float>(v[0] * from_u + v[1] * from_v + v[2])};
  }
};

/// The base colours of a glTF file's materials. Textures are decoded when a material with them is
/// used.
class GltfMaterials {
 public:
  struct Texture {
    std::uint64_t set = 0;  ///< of coordinates: TEXCOORD_0
    GltfTextureTransform transform;
  };

  GltfMaterials(const MeshFile& file, const GltfValue& root, GltfBuffers& buffers)
      : file_(file), root_(root), buffers_(buffers), textures_(file) {}

  /// What a primitive needs to show the texture of its material; nothing if it has none.
  [[nodiscard]] std::optional<Texture> textureOf(std::optional<std::uint64_t> material) const;

  /// Whether the material leaves its opacity to the colours of the vertices and the texture.
  [[nodiscard]] bool hasOpacity(std::optional<std::uint64_t> material) const;

  /// Returns the index in `materials()`. The default material is white.
  /// @param with_texture  false where the primitive has no coordinates for it
  std::uint32_t use(std::optional<std::uint64_t> material, bool with_texture);

  /// What was used, for an Appearance. To be called at the end.
  std::vector<SurfaceMaterial> takeMaterials() { return std::move(materials_); }
  std::vector<vdbdither::Texture> takeTextures() { return textures_.take(); }

 private:
  struct Base {
    GltfValue factor;
    GltfValue texture;
  };

  [[nodiscard]] GltfValue json(std::optional<std::uint64_t> material) const;
  [[nodiscard]] static Base baseOf(const GltfValue& material);
  SurfaceMaterial read(const GltfValue& json, bool has_opacity, bool with_texture);
  void readTexture(const GltfValue& info, bool has_opacity, SurfaceMaterial& material);
  [[nodiscard]] std::uint64_t imageOf(const GltfValue& texture) const;
  std::uint32_t decode(std::uint64_t image, TextureOpacity opacity);

  const MeshFile& file_;
  GltfValue root_;
  GltfBuffers& buffers_;
  std::vector<SurfaceMaterial> materials_;
  MeshTextures textures_;
  std::map<std::pair<std::optional<std::uint64_t>, bool>, std::uint32_t> used_;
  std::map<std::pair<std::uint64_t, TextureOpacity>, std::uint32_t> decoded_;
};

}  // namespace vdbdither
