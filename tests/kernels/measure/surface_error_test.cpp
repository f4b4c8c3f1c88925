#include "ops/kernels/measure/surface_error.h"

#include <cmath>

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include "ops/kernels/measure/axis_errors.h"
#include "ops/kernels/mesh/mesh_measures.h"
#include "tests/support/shapes.h"

namespace vdbdither {
namespace {

using openvdb::Vec3d;

TEST(SurfaceErrors, OfAnOffsetBoxAreTheOffsetOnFacesAndTheDiagonalAtCorners) {
  const ClosestPoints reference(test::boxMesh({0, 0, 0}, {10, 10, 10}));
  const Mesh larger = test::boxMesh(Vec3d(-0.1), Vec3d(10.1));
  const SurfaceErrors errors = surfaceErrors(larger, reference, 0.5);
  ASSERT_EQ(errors.vertices, 8U);
  for (std::size_t n = 0; n < 8; ++n) {
    EXPECT_NEAR(errors.error_mm[n], 0.1 * std::sqrt(3.0), 1e-12);
    EXPECT_EQ(errors.weight_mm2[n], 0) << "points within the large triangles stand for the area";
  }
  const ErrorStatistics by_area = statisticsByArea(errors);
  EXPECT_NEAR(by_area.weight, areaOf(larger), 1e-9);
  EXPECT_NEAR(by_area.percentile(50), 0.1, 1e-12);
  EXPECT_NEAR(by_area.bias_mm, 0.1, 0.001);
  const ErrorStatistics inward =
      statisticsByArea(surfaceErrors(test::boxMesh(Vec3d(0.1), Vec3d(9.9)), reference, 0.5));
  EXPECT_NEAR(inward.bias_mm, -0.1, 1e-12);
  EXPECT_NEAR(inward.mean_mm, 0.1, 1e-12);
  EXPECT_NEAR(inward.maximum_mm, 0.1, 1e-12);
}

TEST(SurfaceErrors, SmallTrianglesGiveAThirdOfTheirAreaToEachCorner) {
  const ClosestPoints reference(test::boxMesh({0, 0, 0}, {1, 1, 1}));
  const Mesh sphere = test::sphereMesh({0, 0, 0}, 1, 40);
  const SurfaceErrors errors = surfaceErrors(sphere, reference, 1);
  EXPECT_EQ(errors.size(), sphere.vertices.size());
  EXPECT_NEAR(statisticsByArea(errors).weight, areaOf(sphere), 1e-9);
  const SurfaceErrors finer = surfaceErrors(sphere, reference, 0.03);
  EXPECT_GT(finer.size(), 2 * sphere.vertices.size());
  EXPECT_NEAR(statisticsByArea(finer).weight, areaOf(sphere), 1e-9);
}

TEST(SurfaceErrors, ThreadsChangeNoBit) {
  const ClosestPoints reference(test::sphereMesh({0.01, 0, 0}, 1, 30));
  const Mesh sphere = test::sphereMesh({0, 0, 0}, 1.01, 90);
  const SurfaceErrors many = surfaceErrors(sphere, reference, 0.1);
  const tbb::global_control single(tbb::global_control::max_allowed_parallelism, 1);
  const SurfaceErrors one = surfaceErrors(sphere, reference, 0.1);
  EXPECT_EQ(many.error_mm, one.error_mm);
  EXPECT_EQ(many.triangle, one.triangle);
}

TEST(ErrorStatistics, AreThoseOfAHandfulOfErrors) {
  SurfaceErrors errors;
  errors.vertices = 4;
  errors.error_mm = {-0.3, 0.1, 0.2, 0.4, 9};
  errors.weight_mm2 = {1, 1, 6, 2, 0};
  const ErrorStatistics by_area = statisticsByArea(errors);
  EXPECT_DOUBLE_EQ(by_area.weight, 10);
  EXPECT_DOUBLE_EQ(by_area.bias_mm, (-0.3 + 0.1 + 1.2 + 0.8) / 10);
  EXPECT_DOUBLE_EQ(by_area.mean_mm, (0.3 + 0.1 + 1.2 + 0.8) / 10);
  EXPECT_DOUBLE_EQ(by_area.rms_mm, std::sqrt((0.09 + 0.01 + 6 * 0.04 + 2 * 0.16) / 10));
  EXPECT_EQ(by_area.maximum_mm, 0.4);
  EXPECT_EQ(by_area.percentile(0), 0.1);
  EXPECT_EQ(by_area.percentile(10), 0.1);
  EXPECT_EQ(by_area.percentile(50), 0.2);
  EXPECT_EQ(by_area.percentile(80), 0.3);
  EXPECT_EQ(by_area.percentile(99), 0.4);
  EXPECT_EQ(by_area.percentile(100), 0.4);
  const ErrorStatistics by_vertex = statisticsByVertex(errors);
  EXPECT_EQ(by_vertex.weight, 4);
  EXPECT_DOUBLE_EQ(by_vertex.bias_mm, 0.1);
  EXPECT_EQ(by_vertex.percentile(75), 0.3);
}

TEST(ErrorStatistics, OfNothingAreZero) {
  const ErrorStatistics none = statisticsByArea({});
  EXPECT_EQ(none.weight, 0);
  EXPECT_EQ(none.percentile(95), 0);
}

TEST(Volume, IsThatOfABoxWhereverItLies) {
  EXPECT_NEAR(volumeOf(test::boxMesh(Vec3d(1000), Vec3d(1000) + Vec3d(1, 2, 3))), 6, 1e-9);
  EXPECT_NEAR(areaOf(test::boxMesh({0, 0, 0}, {1, 2, 3})), 22, 1e-12);
}

/// A reference box, and errors on points of its six faces as `error` of the point and its axis
/// says.
template <typename Error>
SurfaceErrors onBox(const ClosestPoints& reference, const Error& error) {
  SurfaceErrors errors =
      surfaceErrors(test::boxMesh({0.05, 0.05, 0.05}, {9.95, 9.95, 9.95}), reference, 0.25);
  for (std::size_t n = 0; n < errors.size(); ++n) {
    const Vec3d normal = reference.normal(errors.triangle[n]);
    int axis = 0;
    while (std::abs(normal[axis]) < 0.5) ++axis;
    errors.error_mm[n] = error(Vec3d(errors.nearest[n]), axis, normal[axis] > 0);
  }
  return errors;
}

TEST(AxisErrors, TellTheFacesApartByTheAxisThatTheyFace) {
  const ClosestPoints reference(test::boxMesh({0, 0, 0}, {10, 10, 10}));
  const auto axes = axisErrors(
      onBox(reference,
            [](const Vec3d&, int axis, bool up) { return (axis + 1) * (up ? 0.01 : -0.01); }),
      reference, nullptr);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    EXPECT_NEAR(axes[axis].bias_mm, 0, 1e-9);
    EXPECT_NEAR(axes[axis].mean_mm, 0.01 * static_cast<double>(axis + 1), 1e-9);
    EXPECT_GT(axes[axis].correlation, 0) << "the upper side is outside, the lower inside";
    EXPECT_FALSE(axes[axis].phase);
  }
}

TEST(AxisErrors, TheStaircaseIsTheMeanErrorByPhaseOnBothSides) {
  // A part whose faces along z are tilted, so that their height runs through the layers.
  Mesh wedge = test::boxMesh({0, 0, 0}, {10, 10, 10});
  for (Vec3d& p : wedge.vertices) p.z() += 0.1 * p.x();
  const ClosestPoints reference(wedge);
  const Lattice lattice{{0.1, 0.1, 0.1}, {0, 0, 0}, {}};
  Mesh measured = wedge;
  SurfaceErrors errors = surfaceErrors(measured, reference, 0.02);
  for (std::size_t n = 0; n < errors.size(); ++n) {
    const Vec3d normal = reference.normal(errors.triangle[n]);
    const double z = errors.nearest[n].z() / 0.1;
    const double up = std::round(z) - z;  // of what is printed, in layers
    errors.error_mm[n] = std::abs(normal.z()) > 0.5 ? 0.1 * up * (normal.z() > 0 ? 1 : -1) : 0;
  }
  const auto axes = axisErrors(errors, reference, &lattice);
  // A sawtooth of one layer has the RMS 1/√12; sixteen phases see it but for 1/16².
  ASSERT_TRUE(axes[2].phase);
  EXPECT_NEAR(axes[2].phase->staircase_mm, 0.1 / std::sqrt(12), 0.001);
  EXPECT_GT(axes[2].phase->explained, 0.99);
  EXPECT_NEAR(axes[1].phase->staircase_mm, 0, 1e-12);
}

}  // namespace
}  // namespace vdbdither
