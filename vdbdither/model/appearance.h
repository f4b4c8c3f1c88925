#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include <openvdb/Types.h>

namespace vdbdither {

/// An image that lies on a surface.
struct Texture {
  /// Red, green, blue in linear light with the primaries of Rec. 709, each multiplied by the
  /// opacity, and the opacity: shares of 65535.
  using Texel = std::array<std::uint16_t, 4>;

  std::uint32_t width = 0;
  std::uint32_t height = 0;
  std::vector<Texel> texels;  ///< row by row from the top; width · height
};

/// What a texture shows beyond its borders.
enum class TextureWrap : std::uint8_t { repeat, mirror, clamp };

/// The colour of some triangles. The colour of a point is the product of `colour`, the texture
/// where there is one, and the colours of the triangle's corners where there are any.
struct SurfaceMaterial {
  static constexpr std::uint32_t no_texture = ~std::uint32_t{0};

  std::string name;
  openvdb::Vec4f colour{1, 1, 1, 1};  ///< linear red, green, blue, 0 … 1, and the opacity
  std::uint32_t texture = no_texture;
  std::array<TextureWrap, 2> wrap{TextureWrap::repeat, TextureWrap::repeat};  ///< along u, v
  bool is_smooth = true;  ///< texels are interpolated; otherwise each is a rectangle of one colour
  /// If not 0, the surface is opaque where the opacity is at least this, and clear elsewhere.
  float opacity_cutoff = 0;
};

/// How the triangles of a mesh look. Empty vectors leave out what no triangle has.
struct Appearance {
  using Coordinates = std::array<openvdb::Vec2f, 3>;
  using Colours = std::array<openvdb::Vec4f, 3>;

  std::vector<Texture> textures;
  std::vector<SurfaceMaterial> materials;  ///< at least one where there are triangles
  std::vector<std::uint32_t> material;     ///< by triangle: an index in range
  /// By triangle, of its corners: u from left to right, v from top to bottom, 0 … 1 across the
  /// texture. Finite. There may be some although there is no texture.
  std::vector<Coordinates> coordinates;
  /// By triangle, of its corners: linear red, green, blue and the opacity, 0 … 1. Finite.
  std::vector<Colours> colours;

  /// Whether anything is not white.
  [[nodiscard]] bool hasColours() const {
    return !textures.empty() || !colours.empty() ||
           std::any_of(materials.begin(), materials.end(), [](const SurfaceMaterial& one) {
             return one.colour != openvdb::Vec4f(1, 1, 1, 1);
           });
  }
};

/// Returns `appearance` with a texture on the materials that have none, instead of their colour.
Appearance textured(Appearance appearance, Texture texture);

}  // namespace vdbdither
