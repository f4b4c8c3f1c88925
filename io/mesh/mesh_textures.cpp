#include "io/mesh/mesh_textures.h"

#include "io/image/texture.h"
#include "io/mesh/side_file.h"
#include "vdbdither/model/errors.h"

namespace vdbdither {

std::uint32_t MeshTextures::indexOf(std::string_view path) {
  if (const auto known = indices_.find(path); known != indices_.end()) return known->second;
  const SideFile image = readSideFile(file_, "texture", path, most_texture_bytes);
  file_bytes_ += image.bytes.size();
  try {
    textures_.push_back(decodeTexture(image.text(), image.shown));
  } catch (const DataError& error) {
    file_.refuse(error.what());
  }
  texels_ += textures_.back().texels.size();
  try {
    checkTexturesTogether(texels_, file_bytes_);
  } catch (const DataError& error) {
    file_.refuse(std::string("its textures ") + error.what());
  }
  const auto index = static_cast<std::uint32_t>(textures_.size() - 1);
  indices_.emplace(path, index);
  return index;
}

}  // namespace vdbdither
