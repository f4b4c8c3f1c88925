#include "io/mesh/mesh_textures.h"

#include "io/mesh/side_file.h"
#include "vdbdither/model/errors.h"

namespace vdbdither {

std::uint32_t MeshTextures::add(std::string_view bytes, const std::string& shown,
                                TextureOpacity opacity) {
  try {
    textures_.push_back(decodeTexture(bytes, shown, opacity));
  } catch (const DataError& error) {
    file_.refuse(error.what());
  }
  texels_ += textures_.back().texels.size();
  file_bytes_ += bytes.size();
  try {
    checkTexturesTogether(texels_, file_bytes_);
  } catch (const DataError& error) {
    file_.refuse(std::string("its textures ") + error.what());
  }
  return static_cast<std::uint32_t>(textures_.size() - 1);
}

std::uint32_t MeshTextures::indexOf(std::string_view path) {
  if (const auto known = indices_.find(path); known != indices_.end()) return known->second;
  const SideFile image = readSideFile(file_, "texture", path, most_texture_bytes);
  const std::uint32_t index = add(image.text(), image.shown);
  indices_.emplace(path, index);
  return index;
}

}  // namespace vdbdither
