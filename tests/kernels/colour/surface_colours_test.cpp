#include "ops/kernels/colour/surface_colours.h"

#include <memory>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "tests/support/painted_meshes.h"
#include "vdbdither/model/appearance.h"

namespace vdbdither {
namespace {

using openvdb::Vec2f;
using openvdb::Vec3d;
using openvdb::Vec4d;
using openvdb::Vec4f;

const Vec3d pitch_mm(0.1);

Mesh triangle() {
  Mesh mesh;
  mesh.vertices = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  mesh.triangles = {{0, 1, 2}};
  return mesh;
}

double opacityOf(const Mesh& mesh) {
  return SurfaceColours(std::vector<Mesh>{mesh}, pitch_mm).at(0, Vec3d(0.25, 0.25, 0)).w();
}

TEST(SurfaceColours, ACutOffMakesEveryOpacityNoneOrAll) {
  for (const auto& [opacity, cut] : {std::pair{0.6F, 1.0}, {0.5F, 1.0}, {0.4F, 0.0}}) {
    Mesh plain = triangle();
    Appearance appearance;
    appearance.materials.emplace_back().colour = Vec4f(1, 1, 1, opacity);
    appearance.material = {0};
    plain.appearance = std::make_shared<Appearance>(appearance);
    EXPECT_FLOAT_EQ(static_cast<float>(opacityOf(plain)), opacity);
    appearance.materials[0].opacity_cutoff = 0.5F;
    plain.appearance = std::make_shared<Appearance>(appearance);
    EXPECT_EQ(opacityOf(plain), cut) << "of the material, " << opacity;

    Mesh painted = triangle();
    appearance.materials[0].colour = Vec4f(1);
    appearance.colours = {
        {Vec4f(1, 1, 1, opacity), Vec4f(1, 1, 1, opacity), Vec4f(1, 1, 1, opacity)}};
    painted.appearance = std::make_shared<Appearance>(appearance);
    EXPECT_EQ(opacityOf(painted), cut) << "of the corners, " << opacity;

    Mesh textured = triangle();
    SurfaceMaterial material;
    material.opacity_cutoff = 0.5F;
    const double texel = opacity == 0.5F ? 128 / 255.0 : double{opacity};
    test::wrapIn(
        textured,
        test::makeTexture(4, 4,
                          [&](std::uint32_t, std::uint32_t) { return Vec4d(1, 1, 1, texel); }),
        [](const Vec3d& p) { return Vec2f(static_cast<float>(p.x()), static_cast<float>(p.y())); },
        material);
    EXPECT_EQ(opacityOf(textured), cut) << "of the texture, " << opacity;
  }
}

}  // namespace
}  // namespace vdbdither
