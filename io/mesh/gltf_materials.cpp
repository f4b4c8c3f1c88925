// glTF 2.0: ISO/IEC 12113:2022, sections 3.8 and 3.9, and the extensions KHR_texture_transform,
// KHR_materials_transmission, KHR_materials_pbrSpecularGlossiness, KHR_texture_basisu and
// EXT_texture_webp: https://github.com/KhronosGroup/glTF/tree/main/extensions

#include "io/mesh/gltf_materials.h"

#include <algorithm>
#include <cmath>

#include "vdbdither/model/errors.h"
#include "vdbdither/model/interrupt.h"

namespace vdbdither {

namespace {

/// Element `index` of an array of numbers, `otherwise` where there is no array.
double numberIn(const GltfValue& array, std::uint64_t index, double otherwise) {
  return array.exists() ? array.at(index).number(otherwise) : otherwise;
}

double share(double value) { return std::clamp(value, 0.0, 1.0); }

TextureWrap wrapOf(const GltfValue& json) {
  constexpr std::uint64_t repeat = 10497;
  constexpr std::uint64_t mirrored_repeat = 33648;
  constexpr std::uint64_t clamp_to_edge = 33071;
  const std::uint64_t code = json.count(repeat);
  if (code == mirrored_repeat) return TextureWrap::mirror;
  if (code == clamp_to_edge) return TextureWrap::clamp;
  if (code != repeat) json.refuse("is not a wrapping mode");
  return TextureWrap::repeat;
}

/// Of the extension KHR_texture_transform: scaled, then turned, then moved.
GltfTextureTransform transformOf(const GltfValue& json) {
  const GltfValue offset = json["offset"];
  const GltfValue scale = json["scale"];
  const double angle = json["rotation"].number(0);
  const double cosine = std::cos(angle);
  const double sine = std::sin(angle);
  const double scale_u = numberIn(scale, 0, 1);
  const double scale_v = numberIn(scale, 1, 1);
  return {{cosine * scale_u, sine * scale_v, numberIn(offset, 0, 0)},
          {-sine * scale_u, cosine * scale_v, numberIn(offset, 1, 0)}};
}

}  // namespace

GltfValue GltfMaterials::json(std::optional<std::uint64_t> material) const {
  return material ? root_["materials"].at(*material) : GltfValue(file_, nullptr, "materials");
}

GltfMaterials::Base GltfMaterials::baseOf(const GltfValue& material) {
  const GltfValue specular = material["extensions"]["KHR_materials_pbrSpecularGlossiness"];
  if (specular.exists()) return {specular["diffuseFactor"], specular["diffuseTexture"]};
  const GltfValue metallic = material["pbrMetallicRoughness"];
  return {metallic["baseColorFactor"], metallic["baseColorTexture"]};
}

std::optional<GltfMaterials::Texture> GltfMaterials::textureOf(
    std::optional<std::uint64_t> material) const {
  const GltfValue info = baseOf(json(material)).texture;
  if (!info.exists()) return std::nullopt;
  const GltfValue transform = info["extensions"]["KHR_texture_transform"];
  return Texture{transform["texCoord"].count(info["texCoord"].count(0)), transformOf(transform)};
}

bool GltfMaterials::hasOpacity(std::optional<std::uint64_t> material) const {
  const GltfValue mode = json(material)["alphaMode"];
  if (!mode.exists() || mode.text() == "OPAQUE") return false;
  if (mode.text() != "MASK" && mode.text() != "BLEND") mode.refuse("must be OPAQUE, MASK or BLEND");
  return true;
}

std::uint32_t GltfMaterials::use(std::optional<std::uint64_t> material, bool with_texture) {
  const auto [place, is_new] =
      used_.try_emplace({material, with_texture}, static_cast<std::uint32_t>(materials_.size()));
  if (is_new) materials_.push_back(read(json(material), hasOpacity(material), with_texture));
  return place->second;
}

SurfaceMaterial GltfMaterials::read(const GltfValue& json, bool has_opacity, bool with_texture) {
  SurfaceMaterial material;
  material.name = json["name"].text();
  const Base base = baseOf(json);
  for (int c = 0; c < 4; ++c) {
    material.colour[c] =
        static_cast<float>(share(numberIn(base.factor, static_cast<std::uint64_t>(c), 1)));
  }
  if (!has_opacity) material.colour[3] = 1;
  const GltfValue transmission = json["extensions"]["KHR_materials_transmission"];
  const double transmitted = share(transmission["transmissionFactor"].number(0));
  material.colour[3] = static_cast<float>(material.colour[3] * (1 - transmitted));
  if (transmission.has("transmissionTexture"))
    file_.warn("ignored the texture of the transmission of material " + inQuotes(material.name));
  if (json["alphaMode"].text() == "MASK")
    material.opacity_cutoff = static_cast<float>(std::max(json["alphaCutoff"].number(0.5), 0.0));
  if (with_texture) readTexture(base.texture, has_opacity, material);
  return material;
}

void GltfMaterials::readTexture(const GltfValue& info, bool has_opacity,
                                SurfaceMaterial& material) {
  const GltfValue texture = root_["textures"].at(info["index"].count());
  if (texture.has("sampler")) {
    constexpr std::uint64_t nearest = 9728;
    const GltfValue sampler = root_["samplers"].at(texture["sampler"].count());
    material.wrap = {wrapOf(sampler["wrapS"]), wrapOf(sampler["wrapT"])};
    material.is_smooth = sampler["magFilter"].count(0) != nearest;
  }
  material.texture =
      decode(imageOf(texture), has_opacity ? TextureOpacity::keep : TextureOpacity::ignore);
}

std::uint64_t GltfMaterials::imageOf(const GltfValue& texture) const {
  const GltfValue webp = texture["extensions"]["EXT_texture_webp"]["source"];
  if (webp.exists()) return webp.count();
  if (!texture.has("source") && texture["extensions"].has("KHR_texture_basisu"))
    texture.refuse(
        "has only an image of the extension KHR_texture_basisu, which is not read: "
        "use PNG, JPEG or WebP");
  return texture["source"].count();
}

std::uint32_t GltfMaterials::decode(std::uint64_t image, TextureOpacity opacity) {
  const auto found = decoded_.find({image, opacity});
  if (found != decoded_.end()) return found->second;
  throwIfInterrupted();
  const GltfValue json = root_["images"].at(image);
  const GltfBytes source =
      json.has("bufferView")
          ? GltfBytes{buffers_.view(json["bufferView"].count()).bytes, "texture " + json.path()}
          : buffers_.resource("texture", json["uri"], most_texture_bytes);
  return decoded_[{image, opacity}] = textures_.add(source.bytes, source.shown, opacity);
}

}  // namespace vdbdither
