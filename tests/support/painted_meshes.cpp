#include "tests/support/painted_meshes.h"

#include <cmath>
#include <utility>

namespace vdbdither::test {

using openvdb::Vec2f;
using openvdb::Vec3d;
using openvdb::Vec4d;
using openvdb::Vec4f;

Texture makeTexture(std::uint32_t width, std::uint32_t height, const TexelColour& colour) {
  Texture texture{width, height, {}};
  for (std::uint32_t y = 0; y < height; ++y)
    for (std::uint32_t x = 0; x < width; ++x) {
      Vec4d value = colour(x, y);
      for (int c = 0; c < 3; ++c) value[c] *= value[3];
      Texture::Texel& texel = texture.texels.emplace_back();
      for (int c = 0; c < 4; ++c)
        texel[static_cast<std::size_t>(c)] =
            static_cast<std::uint16_t>(std::lround(value[c] * 65535));
    }
  return texture;
}

Texture checkers(std::uint32_t width, std::uint32_t height, std::uint32_t edge) {
  return makeTexture(width, height, [edge](std::uint32_t x, std::uint32_t y) {
    return (x / edge + y / edge) % 2 == 0 ? Vec4d(0.9, 0.2, 0.1, 1) : Vec4d(0.1, 0.3, 0.8, 1);
  });
}

Vec4d textureAt(const Texture& texture, double u, double v,
                const std::array<TextureWrap, 2>& wrap) {
  const auto placeOf = [](long at, long size, TextureWrap mode) {
    if (mode == TextureWrap::clamp) return std::min(std::max(at, 0L), size - 1);
    const long turn = at >= 0 ? at / size : -((size - 1 - at) / size);
    const long within = at - turn * size;
    return mode == TextureWrap::mirror && turn % 2 != 0 ? size - 1 - within : within;
  };
  const double x = u * texture.width - 0.5;
  const double y = v * texture.height - 0.5;
  Vec4d sum(0, 0, 0, 0);
  for (const long column : {std::lround(std::floor(x)), std::lround(std::floor(x)) + 1})
    for (const long row : {std::lround(std::floor(y)), std::lround(std::floor(y)) + 1}) {
      const double share = (1 - std::abs(x - static_cast<double>(column))) *
                           (1 - std::abs(y - static_cast<double>(row)));
      const long at = placeOf(row, texture.height, wrap[1]) * texture.width +
                      placeOf(column, texture.width, wrap[0]);
      for (std::size_t c = 0; c < 4; ++c)
        sum[static_cast<int>(c)] +=
            share * texture.texels[static_cast<std::size_t>(at)][c] / 65535.0;
    }
  return sum;
}

void paintCorners(Mesh& mesh, const std::function<Vec4f(const Vec3d&)>& colour) {
  Appearance appearance;
  appearance.materials.emplace_back();
  appearance.material.assign(mesh.triangles.size(), 0);
  for (const Mesh::Triangle& t : mesh.triangles)
    appearance.colours.push_back(
        {colour(mesh.vertices[t[0]]), colour(mesh.vertices[t[1]]), colour(mesh.vertices[t[2]])});
  mesh.appearance = std::make_shared<Appearance>(std::move(appearance));
}

void wrapIn(Mesh& mesh, Texture texture, const std::function<Vec2f(const Vec3d&)>& coordinates,
            SurfaceMaterial material) {
  Appearance appearance;
  appearance.textures.push_back(std::move(texture));
  material.texture = 0;
  appearance.materials.push_back(std::move(material));
  appearance.material.assign(mesh.triangles.size(), 0);
  for (const Mesh::Triangle& t : mesh.triangles)
    appearance.coordinates.push_back({coordinates(mesh.vertices[t[0]]),
                                      coordinates(mesh.vertices[t[1]]),
                                      coordinates(mesh.vertices[t[2]])});
  mesh.appearance = std::make_shared<Appearance>(std::move(appearance));
}

}  // namespace vdbdither::test
