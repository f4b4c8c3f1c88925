#include "ops/kernels/colour/kubelka_munk.h"

#include <algorithm>
#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "ops/kernels/colour/ink_mixture.h"
#include "ops/kernels/colour/separation.h"
#include "tests/support/coverages.h"

namespace vdbdither {
namespace {

using openvdb::Vec3d;

/// White, black, clear, cyan, magenta and yellow, translucent.
InkSet inks(double share_of_black = 0.5) {
  InkSet set;
  const auto add = [&](const std::string& name, const Vec3d& absorption, const Vec3d& scattering) {
    set.inks.push_back({name, {}, std::nullopt, absorption, scattering});
    set.linear_rgb.emplace_back(0.5);
  };
  add("white", {0.005, 0.003, 0.024}, {6, 9, 24});
  add("black", {3.2, 3.6, 4.2}, {1.7, 1.9, 2.3});
  add("clear", {0, 0, 0}, {0, 0, 0});
  add("cyan", {8.5, 1.4, 0.15}, {0.45, 3.1, 7.3});
  add("magenta", {0.05, 2.7, 1}, {2.4, 0.3, 9});
  add("yellow", {0.007, 0.02, 16}, {2.2, 3.7, 2.8});
  set.clear = 2;
  set.black = share_of_black;
  set.kubelka_munk = SurfaceMirror{0.04, {0.55, 0.6, 0.5}};
  return set;
}

/// The law by its definition.
Vec3d mixed(const InkSet& set, const std::vector<float>& coverages) {
  Vec3d result;
  for (int channel = 0; channel < 3; ++channel) {
    double absorption = 0;
    double scattering = 0;
    for (std::size_t ink = 0; ink < coverages.size(); ++ink) {
      absorption += double{coverages[ink]} * (*set.inks[ink].absorption)[channel];
      scattering += double{coverages[ink]} * (*set.inks[ink].scattering)[channel];
    }
    const double a = 1 + absorption / scattering;
    const double opaque = a - std::sqrt(a * a - 1);
    const double inner = set.kubelka_munk->inner[channel];
    result[channel] = 0.96 * (1 - inner) * opaque / (1 - inner * opaque);
  }
  return result;
}

std::vector<float> randomMixture(std::mt19937& random) {
  std::exponential_distribution<float> draw;
  std::vector<float> coverages(6);
  float sum = 0;
  for (const std::size_t ink : {0, 1, 3, 4, 5}) sum += coverages[ink] = draw(random);
  for (float& coverage : coverages) coverage /= sum;
  return coverages;
}

/// Differences of cube roots of linear light, which are about a hundredth of those of lightness.
double difference(const Vec3d& a, const Vec3d& b) {
  double most = 0;
  for (int channel = 0; channel < 3; ++channel)
    most = std::max(most, std::abs(std::cbrt(a[channel]) - std::cbrt(b[channel])));
  return most;
}

TEST(KubelkaMunk, TheLawAndItsInverseAgree) {
  const InkSet set = inks();
  const KubelkaMunk law(set);
  ASSERT_EQ(law.inks(), 5U);
  std::mt19937 random(1);
  for (int i = 0; i < 50; ++i) {
    const std::vector<float> coverages = randomMixture(random);
    std::vector<double> of_law;
    for (std::size_t ink = 0; ink < law.inks(); ++ink)
      of_law.push_back(double{coverages[law.indexOf(ink)]});
    const Vec3d colour = law.colourOf(of_law);
    EXPECT_LT((colour - mixed(set, coverages)).length(), 1e-6);
    const Vec3d ratios = law.ratiosOf(colour);
    Vec3d balance(0.0);
    for (std::size_t ink = 0; ink < law.inks(); ++ink)
      balance += of_law[ink] * law.balanceOf(ink, ratios);
    EXPECT_LT(balance.length(), 1e-6);
  }
}

TEST(KubelkaMunk, InksMayAbsorbNearlyEverything) {
  InkSet set = inks();
  set.inks[1].absorption = Vec3d(2e8);
  set.inks[1].scattering = Vec3d(1.0);
  const auto separation = separationInto(set);
  std::vector<float> coverages(6);
  for (const float light : {0.0F, 0.01F, 0.2F, 0.9F}) {
    separation->run(openvdb::Vec3s(light), coverages);
    test::expectCoverages(coverages);
  }
}

TEST(KubelkaMunk, TheTableMixesTheColoursThatTheInksCanMix) {
  for (const double share_of_black : {0.0, 0.5, 1.0}) {
    const InkSet set = inks(share_of_black);
    const auto separation = separationInto(set);
    std::mt19937 random(2);
    std::vector<double> differences;
    std::vector<float> coverages(6);
    for (int i = 0; i < 400; ++i) {
      const Vec3d wanted = mixed(set, randomMixture(random));
      separation->run(openvdb::Vec3s(wanted), coverages);
      EXPECT_EQ(coverages[2], 0);
      test::expectCoverages(coverages);
      differences.push_back(difference(mixed(set, coverages), wanted));
    }
    std::sort(differences.begin(), differences.end());
    EXPECT_LT(differences[200], 0.004);
    EXPECT_LT(differences[380], 0.02);
  }
}

TEST(KubelkaMunk, ColoursThatInksCannotMixKeepTheirLightness) {
  const InkSet set = inks();
  const auto separation = separationInto(set);
  const auto lightness = [](const Vec3d& colour) {
    return std::cbrt(0.2126 * colour[0] + 0.7152 * colour[1] + 0.0722 * colour[2]);
  };
  std::vector<float> coverages(6);
  double sum = 0;
  int count = 0;
  for (double hue = 0; hue < 6; hue += 0.1) {
    const auto light = [&](double shift) {
      const double turn = std::fmod(hue + shift, 6.0);
      return 0.03 + 0.5 * std::clamp(std::abs(turn - 3) - 1, 0.0, 1.0);
    };
    const Vec3d wanted(light(0), light(4), light(2));
    separation->run(openvdb::Vec3s(wanted), coverages);
    sum += std::abs(lightness(mixed(set, coverages)) - lightness(wanted));
    ++count;
  }
  EXPECT_LT(sum / count, 0.05);
  separation->run(openvdb::Vec3s(1, 1, 1), coverages);
  EXPECT_GT(coverages[0], 0.98F);
  separation->run(openvdb::Vec3s(0, 0, 0), coverages);
  EXPECT_GT(coverages[1], 0.98F);
}

TEST(KubelkaMunk, WhiteCanBeThatOfTheInk) {
  InkSet set = inks();
  set.media_relative = true;
  const auto separation = separationInto(set);
  std::vector<float> coverages(6);
  separation->run(openvdb::Vec3s(1.0F), coverages);
  EXPECT_NEAR(coverages[0], 1, 1e-5);
  const Vec3d dark = mixed(set, {0, 1, 0, 0, 0, 0});
  const Vec3d light = mixed(set, {1, 0, 0, 0, 0, 0});
  const Vec3d tint(0.9, 0.8, 0.78);
  separation->run(openvdb::Vec3s(tint), coverages);
  EXPECT_LT(difference(mixed(set, coverages), dark + tint * (light - dark)), 0.01);
}

TEST(KubelkaMunk, FewerThanFourInksMixByTheirColours) {
  InkSet set = inks();
  set.inks.resize(2);
  set.linear_rgb = {Vec3d(0.9), Vec3d(0.01)};
  set.clear.reset();
  std::vector<float> coverages(2);
  separationInto(set)->run(openvdb::Vec3s(0.9F), coverages);
  EXPECT_NEAR(coverages[0], 1, 1e-5);
  separationInto(set)->run(openvdb::Vec3s(0.01F), coverages);
  EXPECT_NEAR(coverages[1], 1, 1e-5);
}

}  // namespace
}  // namespace vdbdither
