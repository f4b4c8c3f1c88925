#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "io/mesh/mesh_file.h"
#include "vdbdither/model/appearance.h"

namespace vdbdither {

/// Reads the textures that a mesh file names, each once.
class MeshTextures {
 public:
  explicit MeshTextures(const MeshFile& file) : file_(file) {}

  /// Returns the index of a texture. Refuses what cannot be read, and textures that are too
  /// large together (`checkTexturesTogether`).
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
