#include "ops/kernels/picture/ray_picture.h"

#include <cmath>
#include <numbers>
#include <numeric>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <tbb/task_arena.h>

#include "ops/kernels/mesh/mesh_placement.h"
#include "tests/support/shapes.h"
#include "vdbdither/model/errors.h"

namespace vdbdither {
namespace {

using openvdb::Vec3d;
using testing::HasSubstr;
using testing::ThrowsMessage;

void ignore(double) {}

Camera fromAbove(const Mesh& mesh, double pixel_mm, double distance_mm = 0) {
  Camera camera;
  camera.elevation_degrees = 90;
  camera.pixel_mm = pixel_mm;
  camera.distance_mm = distance_mm;
  fit(camera, mesh, 2);
  return camera;
}

float lightAt(const RayPicture& picture, const Camera& camera, double x_mm, double y_mm) {
  const int column = static_cast<int>(std::floor(x_mm / camera.pixel_mm)) - camera.left;
  const int row = camera.top - 1 - static_cast<int>(std::floor(y_mm / camera.pixel_mm));
  return picture.light
      .at(static_cast<std::size_t>(row) * static_cast<std::size_t>(picture.width) +
          static_cast<std::size_t>(column))
      .x();
}

TEST(RayPicture, AHorizontalOpenPlaceGetsTheSameFromEveryLight) {
  const Mesh plate = test::boxMesh({-3, -2, -0.5}, {3, 2, 0.5});
  const Camera camera = fromAbove(plate, 0.25);
  const RayScene scene(plate);
  for (const Look look : {Look::area, Look::large, Look::sky, Look::staircase})
    EXPECT_NEAR(lightAt(scene.picture(camera, look, 256, 0, ignore), camera, 0.1, 0.1), 1, 0.01);
}

TEST(RayPicture, ASphereUnderTheSkyGetsWhatItSeesOfIt) {
  const Mesh ball = test::sphereMesh({5, 0, 0}, 4, 180);
  const Camera camera = fromAbove(ball, 0.1);
  const RayPicture picture = RayScene(ball).picture(camera, Look::sky, 256, 0, ignore);
  for (double x = -3.75; x < 3.8; x += 0.5) {
    for (double y = -3.75; y < 3.8; y += 0.5) {
      const double square = x * x + y * y;
      if (square > 14) continue;
      const double up = std::sqrt(16 - square) / 4;
      EXPECT_NEAR(lightAt(picture, camera, x, y), (1 + up) / 2, 0.02) << x << " " << y;
    }
  }
}

TEST(RayPicture, WhatLiesInAShadowGetsNoneOfTheLamp) {
  // A roof above the left half of a plate.
  const Mesh mesh =
      joined({test::boxMesh({-4, -4, 0}, {4, 4, 1}), test::boxMesh({-4, -4, 3}, {-1, 4, 3.2})});
  Camera camera = fromAbove(mesh, 0.1);
  camera.azimuth_degrees = 0;
  camera.elevation_degrees = 30;
  fit(camera, mesh, 2);
  const RayPicture picture = RayScene(mesh).picture(camera, Look::area, 64, 0, ignore);
  // The plate's upper face, 0.6 mm below the middle of all, where y is -2.
  const double up = -0.6 * std::cos(std::numbers::pi / 6) - 2 * 0.5;
  EXPECT_LT(lightAt(picture, camera, -2.5, up), 0.25);
  EXPECT_GT(lightAt(picture, camera, 2.5, up), 0.9);
}

TEST(RayPicture, ATintTakesItsShareOfTheLight) {
  const Mesh plate = test::boxMesh({-3, -2, -0.5}, {3, 2, 0.5});
  const Camera camera = fromAbove(plate, 0.25);
  const RayScene scene(plate);
  const RayPicture white = scene.picture(camera, Look::sky, 16, 0, ignore);
  const RayPicture tinted =
      scene.picture(camera, Look::sky, 16, 0, ignore, [](std::uint32_t, const openvdb::Vec3d& p) {
        return p.x() < 0 ? openvdb::Vec3f(1, 0.5F, 0) : openvdb::Vec3f(0, 0.25F, 1);
      });
  const auto at = [&](const RayPicture& picture, int column) {
    return picture.light.at(static_cast<std::size_t>(picture.height / 2 * picture.width + column));
  };
  for (const auto& [column, tint] :
       {std::pair(5, openvdb::Vec3f(1, 0.5F, 0)), std::pair(20, openvdb::Vec3f(0, 0.25F, 1))})
    EXPECT_LT((at(tinted, column) - at(white, column) * tint).length(), 1e-6F) << column;
}

TEST(RayPicture, TheCoverIsWhatTheObjectTakesOfThePixels) {
  const Mesh plate = test::boxMesh({0, 0, 0}, {2.13, 1.37, 1});
  const Camera camera = fromAbove(plate, 0.1);
  const RayPicture picture = RayScene(plate).picture(camera, Look::sky, 64, 0, ignore);
  const double pixels = std::accumulate(picture.cover.begin(), picture.cover.end(), 0.0);
  EXPECT_NEAR(pixels * 0.01, 2.13 * 1.37, 0.01);
  EXPECT_EQ(picture.cover.front(), 0);
  EXPECT_EQ(picture.light.front(), openvdb::Vec3f(0, 0, 0));
}

TEST(RayPicture, NearerThingsAreLargerInPerspective) {
  const Mesh box = test::boxMesh({-5, -5, -5}, {5, 5, 5});
  EXPECT_EQ(fromAbove(box, 0.1).width, 104);
  // The upper face lies at 45 of 50 mm.
  EXPECT_EQ(fromAbove(box, 0.1, 50).width, 2 * 56 + 4);
  const Camera camera = fromAbove(box, 0.1, 50);
  const RayPicture picture = RayScene(box).picture(camera, Look::sky, 16, 0, ignore);
  const double pixels = std::accumulate(picture.cover.begin(), picture.cover.end(), 0.0);
  EXPECT_NEAR(std::sqrt(pixels) * 0.1, 10 * 50 / 45.0, 0.02);
}

TEST(RayPicture, TheAzimuthTurnsTheEyeToTheRight) {
  const Mesh box = test::boxMesh({0, 0, 0}, {1, 2, 3});
  Camera camera;
  camera.pixel_mm = 0.5;
  fit(camera, box, 0);
  EXPECT_EQ(std::pair(camera.width, camera.height), std::pair(2, 6));
  camera.azimuth_degrees = 90;
  fit(camera, box, 0);
  EXPECT_EQ(std::pair(camera.width, camera.height), std::pair(4, 6));
  EXPECT_NEAR(camera.axes()[2].x(), 1, 1e-12);
}

TEST(RayPicture, ThreadsChangeNoBit) {
  // Facets of the size of pixels: many rays meet edges.
  const Mesh ball = test::sphereMesh({0, 0, 0}, 3, 120);
  Camera camera = fromAbove(ball, 0.05);
  camera.elevation_degrees = 40;
  camera.distance_mm = 100;
  fit(camera, ball, 2);
  const auto draw = [&](int threads) {
    RayPicture picture;
    tbb::task_arena(threads).execute(
        [&] { picture = RayScene(ball).picture(camera, Look::area, 8, 3, ignore); });
    return picture;
  };
  const RayPicture one = draw(1);
  for (int again = 0; again < 3; ++again) {
    const RayPicture many = draw(2);
    EXPECT_TRUE(many.light == one.light);
    EXPECT_TRUE(many.cover == one.cover);
  }
}

TEST(RayPicture, AnotherSeedIsAnotherPatternOfTheSameLight) {
  const Mesh ball = test::sphereMesh({0, 0, 0}, 3, 60);
  const Camera camera = fromAbove(ball, 0.1);
  const RayScene scene(ball);
  const RayPicture a = scene.picture(camera, Look::large, 16, 0, ignore);
  const RayPicture b = scene.picture(camera, Look::large, 16, 1, ignore);
  EXPECT_FALSE(a.light == b.light);
  EXPECT_NEAR(lightAt(a, camera, 1, 1), lightAt(b, camera, 1, 1), 0.05);
}

TEST(RayPicture, RefusesWhatHasNoPicture) {
  const Mesh box = test::boxMesh({0, 0, 0}, {10, 10, 10});
  EXPECT_THAT(
      [&] { fromAbove(box, 0.1, 4); },
      ThrowsMessage<DataError>(HasSubstr("the mesh reaches the eye, 4 mm from its centre")));
  EXPECT_THAT([&] { fromAbove(box, 0.0001); },
              ThrowsMessage<DataError>(HasSubstr("more than 16384 pixels on a side")));
}

}  // namespace
}  // namespace vdbdither
