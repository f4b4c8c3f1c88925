#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <memory>

#include <openvdb/Types.h>

#include "vdbdither/model/appearance.h"
#include "vdbdither/model/mesh.h"

namespace vdbdither::test {

/// Returns red, green, blue, not multiplied by the opacity, and the opacity, 0 … 1, of a texel.
using TexelColour = std::function<openvdb::Vec4d(std::uint32_t x, std::uint32_t y)>;

Texture makeTexture(std::uint32_t width, std::uint32_t height, const TexelColour& colour);

/// Squares of `edge` texels in two colours.
Texture checkers(std::uint32_t width, std::uint32_t height, std::uint32_t edge);

/// Returns the value of a texture at (u, v) in double precision, multiplied by the opacity, with
/// texels interpolated.
openvdb::Vec4d textureAt(const Texture& texture, double u, double v,
                         const std::array<TextureWrap, 2>& wrap);

/// Gives the corners of a mesh colours by their positions.
void paintCorners(Mesh& mesh, const std::function<openvdb::Vec4f(const openvdb::Vec3d&)>& colour);

/// Puts a texture on a mesh, with coordinates by the positions of corners.
void wrapIn(Mesh& mesh, Texture texture,
            const std::function<openvdb::Vec2f(const openvdb::Vec3d&)>& coordinates,
            SurfaceMaterial material = {});

}  // namespace vdbdither::test
