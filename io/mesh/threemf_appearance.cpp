// "3MF Materials and Properties Extension" 1.2.1, 3MF Consortium, and section 5 of the core
// specification.

#include "io/mesh/threemf_appearance.h"

#include <algorithm>
#include <array>
#include <utility>

#include "io/image/srgb.h"
#include "io/image/texture.h"
#include "vdbdither/model/errors.h"
#include "vdbdither/model/interrupt.h"

namespace vdbdither {

namespace {

Appearance::Colours whiteCorners() {
  const openvdb::Vec4f white(1, 1, 1, 1);
  return {white, white, white};
}

Appearance::Coordinates noCoordinates() {
  const openvdb::Vec2f origin(0.0F);
  return {origin, origin, origin};
}

openvdb::Vec4f linearOfThreemf(const ThreemfColour& colour) {
  const std::array<float, 256>& linear = linearOfSrgbBytes();
  return {linear[colour[0]], linear[colour[1]], linear[colour[2]],
          static_cast<float>(colour[3]) / 255};
}

std::string shownObject(const ThreemfObject& object) {
  return "object " + std::to_string(object.id) +
         (object.name.empty() ? "" : " (" + inQuotes(object.name) + ")");
}

}  // namespace

void ThreemfAppearance::add(const ThreemfPart& part, const ThreemfObject& object, bool is_turned) {
  constexpr std::size_t triangles_per_look = 1 << 16;
  const bool has_own = !object.properties.empty();
  if (!has_own && object.property.group == ThreemfProperty::no_group) {
    triangles_ += object.triangles.size();
    return;
  }
  for (std::size_t t = 0; t < object.triangles.size(); ++t) {
    if (t % triangles_per_look == 0) throwIfInterrupted();
    const bool is_own =
        t < object.properties.size() && object.properties[t].group != ThreemfProperty::no_group;
    addTriangle(part, object, is_own ? object.properties[t] : object.property, is_turned);
  }
}

void ThreemfAppearance::addTriangle(const ThreemfPart& part, const ThreemfObject& object,
                                    const ThreemfProperty& property, bool is_turned) {
  ++triangles_;
  if (property.group == ThreemfProperty::no_group) return;
  if (last_key_ != Key{&part, property.group}) {
    const auto found = part.groups.find(property.group);
    if (found == part.groups.end()) {
      file_.refuse(shownObject(object) + " has properties of the group " +
                   std::to_string(property.group) + ", which there is not; export it again");
    }
    last_key_ = {&part, property.group};
    last_group_ = &found->second;
  }
  const ThreemfGroup& group = *last_group_;
  if (!group.is_read) {
    unread_.emplace("colours of composite materials and multiproperties");
    return;
  }
  std::array<std::uint32_t, 3> corner = property.index;
  if (is_turned) std::swap(corner[1], corner[2]);
  std::uint32_t material = 0;
  if (!group.coordinates.empty()) {
    checkIndices(object, property, group.coordinates.size());
    material = textureMaterial(part, group);
    setForTriangle(
        appearance_.coordinates,
        {group.coordinates[corner[0]], group.coordinates[corner[1]], group.coordinates[corner[2]]},
        noCoordinates());
  } else if (!group.colours.empty()) {
    checkIndices(object, property, group.colours.size());
    material = plainMaterial();
    setForTriangle(
        appearance_.colours,
        {linearOfThreemf(group.colours[corner[0]]), linearOfThreemf(group.colours[corner[1]]),
         linearOfThreemf(group.colours[corner[2]])},
        whiteCorners());
  } else {
    checkIndices(object, property, group.materials.size());
    material = baseMaterial(part, group, property);
  }
  setForTriangle(appearance_.material, material, std::uint32_t{0});
}

void ThreemfAppearance::checkIndices(const ThreemfObject& object, const ThreemfProperty& property,
                                     std::size_t count) const {
  const std::uint32_t largest = *std::max_element(property.index.begin(), property.index.end());
  if (largest < count) return;
  file_.refuse(shownObject(object) + " has property " + std::to_string(largest) + " of the group " +
               std::to_string(property.group) + ", which counts " + std::to_string(count) +
               ", from 0; export it again");
}

/// The material of triangles without a property, and of those that have only colours of corners.
std::uint32_t ThreemfAppearance::plainMaterial() {
  if (appearance_.materials.empty()) appearance_.materials.emplace_back();
  return 0;
}

std::uint32_t ThreemfAppearance::baseMaterial(const ThreemfPart& part, const ThreemfGroup& group,
                                              const ThreemfProperty& property) {
  const std::uint32_t index = property.index[0];
  const auto [place, is_new] = material_of_base_.try_emplace({{&part, property.group}, index});
  if (is_new) {
    const ThreemfBaseMaterial& base = group.materials[index];
    SurfaceMaterial material;
    material.name = base.name;
    material.colour = linearOfThreemf(base.colour);
    place->second = addMaterial(std::move(material));
  }
  return place->second;
}

std::uint32_t ThreemfAppearance::textureMaterial(const ThreemfPart& part,
                                                 const ThreemfGroup& group) {
  const auto [place, is_new] = material_of_texture_.try_emplace({&part, group.texture});
  if (is_new) {
    const auto found = part.textures.find(group.texture);
    if (found == part.textures.end()) {
      file_.refuse("its texture coordinates name the texture " + std::to_string(group.texture) +
                   ", which there is not; export it again");
    }
    SurfaceMaterial material;
    material.texture = textureOf(found->second);
    material.wrap = found->second.wrap;
    material.is_smooth = found->second.is_smooth;
    place->second = addMaterial(std::move(material));
  }
  return place->second;
}

std::uint32_t ThreemfAppearance::textureOf(const ThreemfTexture& texture) {
  const std::string member = package_.find("texture", texture.path);
  const auto [place, is_new] = texture_of_member_.try_emplace(member, 0);
  if (!is_new) return place->second;
  const auto bytes = package_.read(member, most_texture_bytes);
  return place->second = textures_.add({reinterpret_cast<const char*>(bytes.data()), bytes.size()},
                                       package_.shown(member));
}

std::uint32_t ThreemfAppearance::addMaterial(SurfaceMaterial material) {
  plainMaterial();
  appearance_.materials.push_back(std::move(material));
  return static_cast<std::uint32_t>(appearance_.materials.size() - 1);
}

/// Sets the value of the last triangle; those before it that have none get `before`.
template <class Value>
void ThreemfAppearance::setForTriangle(std::vector<Value>& values, const Value& value,
                                       const Value& before) {
  values.resize(triangles_ - 1, before);
  values.push_back(value);
}

std::shared_ptr<const Appearance> ThreemfAppearance::take() {
  if (appearance_.material.empty()) return nullptr;
  appearance_.material.resize(triangles_, 0);
  if (!appearance_.coordinates.empty()) appearance_.coordinates.resize(triangles_, noCoordinates());
  if (!appearance_.colours.empty()) appearance_.colours.resize(triangles_, whiteCorners());
  appearance_.textures = textures_.take();
  return std::make_shared<const Appearance>(std::move(appearance_));
}

}  // namespace vdbdither
