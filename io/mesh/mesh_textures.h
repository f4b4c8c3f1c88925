#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "io/image/texture.h"
#include "io/mesh/mesh_file.h"
#include "vdbdither/model/appearance.h"

namespace vdbdither {

/// The textures of a mesh file. Refuses, in its name, what cannot be decoded, and textures that are
/// too large together (`checkTexturesTogether`).
class MeshTextures {
 public:
  explicit MeshTextures(const MeshFile& file) : file_(file) {}

  /// Decodes a texture and returns its index.
  /// @param bytes, shown, opacity  see `decodeTexture`
  std::uint32_t add(std::string_view bytes, const std::string& shown,
                    TextureOpacity opacity = TextureOpacity::keep);

  /// Returns the index of the texture in a file beside the mesh, which is read once.
  /// @param path  as `readSideFile` takes it
  std::uint32_t indexOf(std::string_view path);

  std::vector<Texture> take() { return std::move(textures_); }

 private:
  const MeshFile& file_;
  std::map<std::string, std::uint32_t, std::less<>> indices_;
  std::uint64_t texels_ = 0;
  std::uint64_t file_bytes_ = 0;
  std::vector<Texture> textures_;
};

}  // namespace vdbdither
