#include "ops/kernels/measure/facet_roughness.h"

#include <cmath>
#include <numbers>
#include <random>
#include <set>

#include <gtest/gtest.h>

#include "tests/support/shapes.h"

namespace vdbdither {
namespace {

using openvdb::Vec2d;
using openvdb::Vec3d;

HeightField waves(double wavelength_mm, double amplitude_mm) {
  HeightField field;
  for (int x = 0; x < 400; ++x) {
    for (int y = 0; y < 200; ++y) {
      const Vec2d at(0.02 * x, 0.02 * y);
      field.at_mm.push_back(at);
      field.height_mm.push_back(amplitude_mm *
                                std::sin(2 * std::numbers::pi * (at.x() + 0.003) / wavelength_mm));
      field.weight.push_back(1);
    }
  }
  return field;
}

TEST(HeightField, LevellingTakesAnyPlaneAway) {
  HeightField field = waves(0.5, 0);
  for (std::size_t n = 0; n < field.weight.size(); ++n) {
    field.height_mm[n] = 0.3 + 0.01 * field.at_mm[n].x() - 0.02 * field.at_mm[n].y();
    field.weight[n] = 1 + static_cast<double>(n % 3);
  }
  field.level();
  EXPECT_NEAR(field.rms(), 0, 1e-12);
}

TEST(HeightField, WavesHaveTheirMeanSizeAndRms) {
  const HeightField field = waves(0.5, 0.01);
  EXPECT_NEAR(field.rms(), 0.01 / std::numbers::sqrt2, 2e-5);
  EXPECT_NEAR(field.meanSize(), 0.01 * 2 / std::numbers::pi, 2e-5);
}

TEST(HeightField, TheCutoffHalvesItsOwnWavelengthKeepsLongOnesAndDropsShortOnes) {
  const auto kept = [](double wavelength_mm) {
    return waves(wavelength_mm, 0.01).rmsBeyond(0.5) / (0.01 / std::numbers::sqrt2);
  };
  EXPECT_NEAR(kept(0.5), 0.5, 0.03);
  EXPECT_NEAR(kept(4), 1, 0.03);
  EXPECT_LT(kept(0.2), 0.05);
}

TEST(Facets, AreTheFacesOfABoxAndTheTrianglesOfASphere) {
  const std::vector<std::uint32_t> box =
      facetsOf(test::transformed(test::boxMesh({0, 0, 0}, {1, 2, 3}), {2, 3, 4}, {5, 6, 7}));
  EXPECT_EQ(std::set<std::uint32_t>(box.begin(), box.end()).size(), 6U);
  EXPECT_EQ(box.front(), 0U);
  const Mesh sphere = test::sphereMesh({0, 0, 0}, 1, 20);
  const std::vector<std::uint32_t> facets = facetsOf(sphere);
  // The quads between two rings are planar; those at the poles are triangles.
  EXPECT_EQ(std::set<std::uint32_t>(facets.begin(), facets.end()).size(), 20U * 40);
}

TEST(FacetRoughness, OfABoxIsThatOfEveryFaceWithoutItsEdges) {
  const ClosestPoints reference(test::boxMesh({0, 0, 0}, {6, 8, 10}));
  SurfaceErrors errors = surfaceErrors(reference.mesh(), reference, 0.05);
  for (std::size_t n = 0; n < errors.size(); ++n) {
    const Vec3d at(errors.nearest[n]);
    const Vec3d normal = reference.normal(errors.triangle[n]);
    // Rough on top, and spoiled along its edges.
    if (normal.z() < 0.5) continue;
    const double inside = std::min({at.x(), 6 - at.x(), at.y(), 8 - at.y()});
    errors.error_mm[n] = inside < 0.4 ? 1 : 0.02 + 0.01 * std::sin(2 * std::numbers::pi * at.x());
  }
  const auto facets = facetRoughness(errors, reference, {});
  ASSERT_EQ(facets.size(), 6U);
  EXPECT_NEAR(facets[0].area_mm2, 80, 1e-9) << "largest first";
  int rough = 0;
  for (const FacetRoughness& facet : facets) {
    if (facet.normal.z() < 0.5) {
      EXPECT_NEAR(facet.sq_mm, 0, 1e-9);
      continue;
    }
    ++rough;
    EXPECT_NEAR(facet.area_mm2, 48, 1e-9);
    EXPECT_NEAR(facet.measured_mm2, 5 * 7, 0.5);
    EXPECT_NEAR(facet.bias_mm, 0.02, 2e-4);
    EXPECT_NEAR(facet.sq_mm, 0.01 / std::numbers::sqrt2, 2e-4);
    EXPECT_NEAR(facet.sq_band_mm, facet.sq_mm, 5e-4);
  }
  EXPECT_EQ(rough, 1);
}

TEST(FacetRoughness, LeavesSmallFacetsOut) {
  const ClosestPoints reference(test::boxMesh({0, 0, 0}, {0.5, 2, 2}));
  const SurfaceErrors errors = surfaceErrors(reference.mesh(), reference, 0.1);
  RoughnessRules rules;
  rules.minimum_area_mm2 = 2;
  EXPECT_EQ(facetRoughness(errors, reference, rules).size(), 2U);
  rules.maximum_facets = 1;
  EXPECT_EQ(facetRoughness(errors, reference, rules).size(), 1U);
}

}  // namespace
}  // namespace vdbdither
