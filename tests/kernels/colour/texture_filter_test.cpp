#include "ops/kernels/colour/texture_filter.h"

#include <algorithm>
#include <cmath>
#include <random>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "ops/kernels/colour/texture_coverage.h"
#include "tests/support/painted_meshes.h"

namespace vdbdither {
namespace {

using openvdb::Vec2d;
using openvdb::Vec2f;
using openvdb::Vec4d;
using openvdb::Vec4f;
using test::checkers;
using test::makeTexture;
using test::textureAt;

constexpr std::array<TextureWrap, 2> repeated{TextureWrap::repeat, TextureWrap::repeat};

/// The mean of a texture over a box around (u, v) that `edges` span, from many samples.
Vec4d meanOver(const Texture& texture, double u, double v, const std::array<Vec2d, 3>& edges,
               const std::array<TextureWrap, 2>& wrap) {
  constexpr int count = 40;
  Vec4d sum(0, 0, 0, 0);
  for (int i = 0; i < count; ++i)
    for (int j = 0; j < count; ++j)
      for (int k = 0; k < count; ++k) {
        const Vec2d at = edges[0] * ((i + 0.5) / count - 0.5) +
                         edges[1] * ((j + 0.5) / count - 0.5) +
                         edges[2] * ((k + 0.5) / count - 0.5);
        sum += textureAt(texture, u + at.x(), v + at.y(), wrap);
      }
  return sum / (double{count} * count * count);
}

double difference(const Vec4f& a, const Vec4d& b) {
  double most = 0;
  for (int c = 0; c < 4; ++c) most = std::max(most, std::abs(a[c] - b[c]));
  return most;
}

struct Errors {
  double mean = 0;
  double percentile_99 = 0;
};

/// The errors at random places under boxes whose longest edge covers `texels`.
Errors errorsOf(const Texture& texture, double texels) {
  const FilteredTexture filtered(texture);
  std::mt19937 random(3);
  std::uniform_real_distribution<double> share(0, 1);
  std::vector<double> errors;
  for (int n = 0; n < 60; ++n) {
    std::array<Vec2d, 3> edges;
    for (Vec2d& edge : edges) {
      const double turn = 2 * M_PI * share(random);
      const double length = texels * (0.3 + 0.7 * share(random));
      edge =
          Vec2d(std::cos(turn) * length / texture.width, std::sin(turn) * length / texture.height);
    }
    const Vec2f at(static_cast<float>(share(random)), static_cast<float>(share(random)));
    errors.push_back(difference(filtered.sample(at, filtered.footprint(edges), repeated, true),
                                meanOver(texture, at.x(), at.y(), edges, repeated)));
  }
  std::sort(errors.begin(), errors.end());
  Errors found;
  for (const double error : errors) found.mean += error / static_cast<double>(errors.size());
  found.percentile_99 = errors[errors.size() * 99 / 100];
  return found;
}

TEST(TextureFilter, AveragesFineCheckersToTheirMean) {
  for (const double texels : {8.0, 20.0, 70.0, 300.0}) {
    const Errors errors = errorsOf(checkers(256, 192, 1), texels);
    EXPECT_LT(errors.mean, 0.01) << texels;
    EXPECT_LT(errors.percentile_99, 0.03) << texels;
  }
}

TEST(TextureFilter, FollowsTexturesThatAreCoarserThanVoxels) {
  for (const double texels : {0.05, 0.3, 0.9}) {
    const Errors errors = errorsOf(checkers(64, 48, 4), texels);
    EXPECT_LT(errors.mean, 0.01) << texels;
    EXPECT_LT(errors.percentile_99, 0.03) << texels;
  }
}

TEST(TextureFilter, AveragesSmoothTextures) {
  const Texture waves = makeTexture(200, 150, [](std::uint32_t x, std::uint32_t y) {
    const double u = x / 200.0;
    const double v = y / 150.0;
    return Vec4d(0.5 + 0.4 * std::sin(2 * M_PI * (4 * u + v)), 0.5 + 0.4 * std::cos(6 * M_PI * v),
                 0.3, 0.6 + 0.3 * std::sin(2 * M_PI * u));
  });
  for (const double texels : {1.0, 5.0, 12.0, 25.0}) {
    const Errors errors = errorsOf(waves, texels);
    EXPECT_LT(errors.mean, 0.01) << texels;
    EXPECT_LT(errors.percentile_99, 0.03) << texels;
  }
}

TEST(TextureFilter, CopiesHaveTheExactMeanOfOddSizes) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> share(0, 1);
  Vec4d mean(0, 0, 0, 0);
  const Texture noise = makeTexture(37, 11, [&](std::uint32_t, std::uint32_t) {
    return Vec4d(share(random), share(random), share(random), 1);
  });
  for (const Texture::Texel& texel : noise.texels)
    for (std::size_t c = 0; c < 4; ++c) mean[static_cast<int>(c)] += texel[c] / 65535.0;
  mean /= 37.0 * 11;
  const FilteredTexture filtered(noise);
  const std::array<Vec2d, 3> everything{Vec2d(900, 0), Vec2d(0, 900), Vec2d(0, 0)};
  const TextureFootprint footprint = filtered.footprint(everything);
  EXPECT_EQ(footprint.level, 6);
  EXPECT_LT(difference(filtered.sample({0.3F, 0.8F}, footprint, repeated, true), mean), 1e-4);
}

TEST(TextureFilter, WhatNoTriangleShowsIsNotAveraged) {
  // Charts of 24 texels in black.
  const Texture atlas = makeTexture(128, 128, [](std::uint32_t x, std::uint32_t y) {
    return x % 32 < 24 && y % 32 < 24 ? Vec4d(0.8, 0.6, 0.4, 1) : Vec4d(0, 0, 0, 1);
  });
  TextureCoverage coverage(128, 128);
  for (float x = 0; x < 1; x += 0.25F)
    for (float y = 0; y < 1; y += 0.25F) {
      // The neighbours of texels at the border are shown too.
      const Vec2f low(x + 2 / 128.0F, y + 2 / 128.0F);
      const Vec2f high(x + 22 / 128.0F, y + 22 / 128.0F);
      coverage.add({low, Vec2f(high.x(), low.y()), high}, repeated);
      coverage.add({low, high, Vec2f(low.x(), high.y())}, repeated);
    }
  const FilteredTexture aware(atlas, coverage.shown());
  const FilteredTexture unaware(atlas);
  const auto footprint = aware.footprint({Vec2d(0.15, 0), Vec2d(0, 0.15), Vec2d(0, 0)});
  ASSERT_GT(footprint.level, 0);
  const Vec2f corner(2 / 128.0F, 2 / 128.0F);
  EXPECT_LT(difference(aware.sample(corner, footprint, repeated, true), Vec4d(0.8, 0.6, 0.4, 1)),
            1e-3);
  EXPECT_GT(difference(unaware.sample(corner, footprint, repeated, true), Vec4d(0.8, 0.6, 0.4, 1)),
            0.2);
}

TEST(TextureFilter, ShownTexelsAreThoseOfTheTriangleAndTheirNeighbours) {
  TextureCoverage coverage(12, 8);
  coverage.add({Vec2f(4 / 12.0F, 2 / 8.0F), Vec2f(8 / 12.0F, 2 / 8.0F), Vec2f(4 / 12.0F, 6 / 8.0F)},
               repeated);
  std::string picture;
  for (std::size_t n = 0; n < coverage.shown().size(); ++n)
    picture += std::string(coverage.shown()[n] != 0 ? "#" : ".") + (n % 12 == 11 ? "\n" : "");
  EXPECT_EQ(picture,
            "............\n"
            "...#######..\n"
            "...#######..\n"
            "...#######..\n"
            "...######...\n"
            "...#####....\n"
            "...####.....\n"
            "...###......\n");
}

TEST(TextureFilter, TransparentTexelsDoNotColourOthers) {
  const Texture half = makeTexture(64, 64, [](std::uint32_t x, std::uint32_t) {
    return x % 2 == 0 ? Vec4d(1, 0, 0, 1) : Vec4d(0, 1, 0, 0);
  });
  const FilteredTexture filtered(half);
  const auto footprint = filtered.footprint({Vec2d(0.5, 0), Vec2d(0, 0.5), Vec2d(0, 0)});
  const Vec4f colour = filtered.sample({0.5F, 0.5F}, footprint, repeated, true);
  EXPECT_NEAR(colour.w(), 0.5, 0.01);
  EXPECT_NEAR(colour.x() / colour.w(), 1, 1e-3);
  EXPECT_NEAR(colour.y(), 0, 1e-3);
}

TEST(TextureFilter, WrapsAsStated) {
  const Texture ramp =
      makeTexture(4, 1, [](std::uint32_t x, std::uint32_t) { return Vec4d(x / 4.0, 0, 0, 1); });
  const FilteredTexture filtered(ramp);
  const TextureFootprint point;
  const auto red = [&](float u, TextureWrap wrap) {
    return filtered.sample({u, 0.5F}, point, {wrap, wrap}, false).x();
  };
  EXPECT_NEAR(red(1.125F, TextureWrap::repeat), 0, 1e-4);
  EXPECT_NEAR(red(-0.125F, TextureWrap::repeat), 0.75, 1e-4);
  EXPECT_NEAR(red(1.125F, TextureWrap::mirror), 0.75, 1e-4);
  EXPECT_NEAR(red(2.125F, TextureWrap::mirror), 0, 1e-4);
  EXPECT_NEAR(red(-0.375F, TextureWrap::mirror), 0.25, 1e-4);
  EXPECT_NEAR(red(7, TextureWrap::clamp), 0.75, 1e-4);
  EXPECT_NEAR(red(-7, TextureWrap::clamp), 0, 1e-4);
  EXPECT_NEAR(red(3e38F, TextureWrap::clamp), 0.75, 1e-4);
}

TEST(TextureFilter, RectanglesHaveOneColourAndSmoothTexelsDoNot) {
  const Texture ramp =
      makeTexture(2, 1, [](std::uint32_t x, std::uint32_t) { return Vec4d(x, 0, 0, 1); });
  const FilteredTexture filtered(ramp);
  constexpr std::array<TextureWrap, 2> clamped{TextureWrap::clamp, TextureWrap::clamp};
  EXPECT_EQ(filtered.sample({0.45F, 0.5F}, {}, clamped, false).x(), 0);
  EXPECT_NEAR(filtered.sample({0.45F, 0.5F}, {}, clamped, true).x(), 0.4, 1e-4);
}

}  // namespace
}  // namespace vdbdither
