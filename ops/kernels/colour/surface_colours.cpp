#include "ops/kernels/colour/surface_colours.h"

#include <algorithm>
#include <cstddef>

#include <tbb/parallel_for.h>

#include "ops/kernels/colour/corner_weights.h"
#include "ops/kernels/colour/texture_coverage.h"

namespace vdbdither {

using openvdb::Vec2d;
using openvdb::Vec2f;
using openvdb::Vec3d;
using openvdb::Vec4f;

namespace {

bool isLessThanOpaque(const Appearance& appearance) {
  constexpr std::uint16_t opaque = 65535;
  return std::any_of(appearance.materials.begin(), appearance.materials.end(),
                     [](const SurfaceMaterial& material) { return material.colour.w() < 1; }) ||
         std::any_of(appearance.textures.begin(), appearance.textures.end(),
                     [](const Texture& texture) {
                       return std::any_of(
                           texture.texels.begin(), texture.texels.end(),
                           [](const Texture::Texel& texel) { return texel[3] < opaque; });
                     }) ||
         std::any_of(appearance.colours.begin(), appearance.colours.end(),
                     [](const Appearance::Colours& colours) {
                       return std::any_of(colours.begin(), colours.end(),
                                          [](const Vec4f& colour) { return colour.w() < 1; });
                     });
}

/// The texels of every texture that triangles show.
std::vector<TextureCoverage> coveragesOf(const Appearance& appearance) {
  std::vector<TextureCoverage> coverages;
  for (const Texture& texture : appearance.textures)
    coverages.emplace_back(texture.width, texture.height);
  for (std::size_t t = 0; t < appearance.coordinates.size(); ++t) {
    const SurfaceMaterial& material = appearance.materials[appearance.material[t]];
    if (material.texture != SurfaceMaterial::no_texture)
      coverages[material.texture].add(appearance.coordinates[t], material.wrap);
  }
  return coverages;
}

}  // namespace

SurfaceColours::SurfaceColours(std::span<const Mesh> meshes, const Vec3d& pitch_mm) {
  for (const Mesh& mesh : meshes) add(mesh);
  const bool textured = std::any_of(sources_.begin(), sources_.end(),
                                    [](const Source& source) { return !source.textures.empty(); });
  if (!textured) return;
  footprints_.resize(triangles_.size());
  tbb::parallel_for(std::size_t{0}, triangles_.size(), [&](std::size_t t) {
    footprints_[t] = footprintOf(static_cast<std::uint32_t>(t), pitch_mm);
  });
}

void SurfaceColours::add(const Mesh& mesh) {
  Source& source = sources_.emplace_back();
  source.appearance = mesh.appearance;
  source.first = static_cast<std::uint32_t>(triangles_.size());
  if (source.appearance) {
    const std::vector<TextureCoverage> coverages = coveragesOf(*source.appearance);
    for (std::size_t n = 0; n < coverages.size(); ++n)
      source.textures.emplace_back(source.appearance->textures[n], coverages[n].shown());
    has_opacity_ = has_opacity_ || isLessThanOpaque(*source.appearance);
  }
  const auto first = static_cast<std::uint32_t>(vertices_.size());
  vertices_.insert(vertices_.end(), mesh.vertices.begin(), mesh.vertices.end());
  for (const Mesh::Triangle& t : mesh.triangles)
    triangles_.push_back({t[0] + first, t[1] + first, t[2] + first});
}

const SurfaceColours::Source& SurfaceColours::sourceOf(std::uint32_t triangle) const {
  auto next =
      std::upper_bound(sources_.begin(), sources_.end(), triangle,
                       [](std::uint32_t t, const Source& source) { return t < source.first; });
  return *--next;
}

/// The box of a voxel on the texture: a gradient of (u, v) in the plane of the triangle turns each
/// edge of the box into a change of (u, v).
TextureFootprint SurfaceColours::footprintOf(std::uint32_t triangle, const Vec3d& pitch_mm) const {
  const Source& source = sourceOf(triangle);
  if (source.textures.empty() || source.appearance->coordinates.empty()) return {};
  const Appearance& appearance = *source.appearance;
  const std::uint32_t texture =
      appearance.materials[appearance.material[triangle - source.first]].texture;
  if (texture == SurfaceMaterial::no_texture) return {};
  const Mesh::Triangle& corners = triangles_[triangle];
  const Vec3d first = vertices_[corners[1]] - vertices_[corners[0]];
  const Vec3d second = vertices_[corners[2]] - vertices_[corners[0]];
  const Vec3d normal = first.cross(second);
  const double whole = normal.lengthSqr();
  if (!(whole > 0)) return {};
  const Appearance::Coordinates& at = appearance.coordinates[triangle - source.first];
  const auto gradient = [&](int axis) {
    const double along_first = double{at[1][axis]} - double{at[0][axis]};
    const double along_second = double{at[2][axis]} - double{at[0][axis]};
    return (second.cross(normal) * along_first + normal.cross(first) * along_second) / whole;
  };
  const Vec3d u = gradient(0) * pitch_mm;
  const Vec3d v = gradient(1) * pitch_mm;
  return source.textures[texture].footprint(
      {Vec2d(u.x(), v.x()), Vec2d(u.y(), v.y()), Vec2d(u.z(), v.z())});
}

Vec4f SurfaceColours::at(std::uint32_t triangle, const Vec3d& p_mm) const {
  const Source& source = sourceOf(triangle);
  if (!source.appearance) return {1, 1, 1, 1};
  const Appearance& appearance = *source.appearance;
  const std::uint32_t within = triangle - source.first;
  const SurfaceMaterial& material = appearance.materials[appearance.material[within]];
  const bool textured = material.texture != SurfaceMaterial::no_texture;
  const auto cut = [&](Vec4f colour) {
    if (material.opacity_cutoff > 0) colour.w() = colour.w() >= material.opacity_cutoff ? 1 : 0;
    return colour;
  };
  Vec4f colour = material.colour;
  if (!textured && appearance.colours.empty()) return cut(colour);

  const Vec3d& a = vertices_[triangles_[triangle][0]];
  const Vec3d& b = vertices_[triangles_[triangle][1]];
  const Vec3d& c = vertices_[triangles_[triangle][2]];
  const CornerWeights weights = nearestPlace(a, b, c, p_mm).weights;
  if (!appearance.colours.empty()) colour *= mixed(appearance.colours[within], weights);
  if (textured && !appearance.coordinates.empty()) {
    Vec4f texel = source.textures[material.texture].sample(
        mixed(appearance.coordinates[within], weights), footprints_[triangle], material.wrap,
        material.is_smooth);
    const float opacity = texel.w();
    if (opacity > 0) texel /= opacity;
    texel.w() = opacity;
    colour *= texel;
  }
  return cut(colour);
}

double SurfaceColours::memoryBytes() const {
  const auto bytes = [](const auto& vector) {
    return static_cast<double>(vector.capacity() * sizeof(vector[0]));
  };
  double sum = bytes(vertices_) + bytes(triangles_) + bytes(footprints_);
  for (const Source& source : sources_) {
    if (!source.appearance) continue;
    sum += bytes(source.appearance->material) + bytes(source.appearance->coordinates) +
           bytes(source.appearance->colours);
    for (const Texture& texture : source.appearance->textures) sum += bytes(texture.texels);
    for (const FilteredTexture& texture : source.textures) sum += texture.memoryBytes();
  }
  return sum;
}

}  // namespace vdbdither
