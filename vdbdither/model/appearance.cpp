#include "vdbdither/model/appearance.h"

#include <utility>

namespace vdbdither {

Appearance textured(Appearance appearance, Texture texture) {
  const auto added = static_cast<std::uint32_t>(appearance.textures.size());
  appearance.textures.push_back(std::move(texture));
  for (SurfaceMaterial& material : appearance.materials) {
    if (material.texture != SurfaceMaterial::no_texture) continue;
    material.texture = added;
    material.colour = {1, 1, 1, material.colour.w()};
  }
  return appearance;
}

}  // namespace vdbdither
