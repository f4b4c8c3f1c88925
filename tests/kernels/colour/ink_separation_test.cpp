#include "ops/kernels/colour/ink_separation.h"

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "ops/kernels/colour/table_separation.h"
#include "tests/support/coverages.h"
#include "vdbdither/model/errors.h"

namespace vdbdither {
namespace {

using openvdb::Vec3d;
using openvdb::Vec3s;
using test::expectCoverages;

const Vec3d white{0.87, 0.87, 0.87};
const Vec3d black{0.0103, 0.0103, 0.0123};
const Vec3d cyan{0.0, 0.1022, 0.3419};
const Vec3d magenta{0.3813, 0.0152, 0.1221};
const Vec3d yellow{0.5776, 0.5089, 0.0009};
const Vec3d orange{0.6, 0.2, 0.01};
const Vec3d green{0.05, 0.4, 0.1};

InkSet setOf(const std::vector<Vec3d>& colours, double share_of_black = 0.5,
             const Vec3d& yule_nielsen = Vec3d(2.0)) {
  InkSet set;
  for (const Vec3d& colour : colours) {
    set.inks.push_back({"ink" + std::to_string(set.inks.size()), {}});
    set.linear_rgb.push_back(colour);
  }
  set.black = share_of_black;
  set.yule_nielsen = yule_nielsen;
  return set;
}

/// The law of Yule and Nielsen, by the library's powers.
Vec3d mixed(const InkSet& set, const std::vector<float>& coverages) {
  Vec3d result;
  for (int channel = 0; channel < 3; ++channel) {
    const double n = set.yule_nielsen[channel];
    double sum = 0;
    for (std::size_t ink = 0; ink < coverages.size(); ++ink)
      sum += double{coverages[ink]} * std::pow(set.linear_rgb[ink][channel], 1 / n);
    result[channel] = std::pow(sum, n);
  }
  return result;
}

std::vector<float> separated(const Separation& separation, const InkSet& set, const Vec3d& colour) {
  std::vector<float> coverages(set.inks.size(), -1);
  separation.run(Vec3s(colour), coverages);
  return coverages;
}

class RandomMixtures {
 public:
  explicit RandomMixtures(unsigned seed) : random_(seed) {}
  std::vector<float> operator()(std::size_t inks) {
    std::vector<float> coverages(inks);
    std::exponential_distribution<float> draw;
    float sum = 0;
    for (float& coverage : coverages) sum += coverage = draw(random_);
    for (float& coverage : coverages) coverage /= sum;
    return coverages;
  }
  Vec3d colour() {
    std::uniform_real_distribution<double> draw(0, 1);
    const double red = draw(random_);
    const double green_light = draw(random_);
    return {red, green_light, draw(random_)};
  }

 private:
  std::mt19937 random_;
};

TEST(InkSeparation, IsExactForEveryColourThatTheInksMix) {
  const std::vector<std::vector<Vec3d>> sets = {
      {white, black, yellow},
      {white, cyan, magenta, yellow},
      {white, black, cyan, magenta, yellow},
      {white, black, cyan, magenta, yellow, orange, green}};
  RandomMixtures mixtures(1);
  for (const auto& colours : sets) {
    for (const Vec3d& n : {Vec3d(1.0), Vec3d(2.0), Vec3d(1.3, 2.5, 6)}) {
      for (const double share_of_black : {0.0, 0.3, 1.0}) {
        const InkSet set = setOf(colours, share_of_black, n);
        const InkSeparation separation(set);
        for (int i = 0; i < 200; ++i) {
          const Vec3d wanted = mixed(set, mixtures(colours.size()));
          const std::vector<float> coverages = separated(separation, set, wanted);
          expectCoverages(coverages);
          const Vec3d made = mixed(set, coverages);
          EXPECT_LT((made - wanted).length(), 2e-5)
              << colours.size() << " inks, n " << n << ": " << wanted << " became " << made;
        }
      }
    }
  }
}

TEST(InkSeparation, IsExactForInksAtTheCornersOfACube) {
  std::mt19937 random(9);
  RandomMixtures mixtures(10);
  for (int run = 0; run < 400; ++run) {
    std::vector<Vec3d> corners;
    for (int corner = 0; corner < 8; ++corner)
      corners.emplace_back(corner & 1, corner >> 1 & 1, corner >> 2 & 1);
    std::shuffle(corners.begin(), corners.end(), random);
    corners.resize(2 + random() % 7);
    const InkSet set = setOf(corners, 0.5 * static_cast<double>(random() % 3));
    const InkSeparation separation(set);
    // Inks in one line are mixed by lightness.
    if (corners.size() == 2) continue;
    for (int i = 0; i < 20; ++i) {
      const Vec3d wanted = mixed(set, mixtures(corners.size()));
      const std::vector<float> coverages = separated(separation, set, wanted);
      expectCoverages(coverages);
      ASSERT_LT((mixed(set, coverages) - wanted).length(), 2e-5) << "run " << run;
    }
    for (std::size_t ink = 0; ink < corners.size(); ++ink)
      ASSERT_NEAR(separated(separation, set, corners[ink])[ink], 1, 1e-5) << "run " << run;
  }
}

TEST(InkSeparation, GivesCoveragesForEveryColour) {
  const InkSet set = setOf({white, black, cyan, magenta, yellow});
  const InkSeparation separation(set);
  for (const double red : {-1.0, 0.0, 0.5, 1.0, 7.0})
    for (const double green_light : {-1.0, 0.0, 0.5, 1.0, 7.0})
      for (const double blue : {-1.0, 0.0, 0.5, 1.0, 7.0})
        expectCoverages(separated(separation, set, {red, green_light, blue}));
}

TEST(InkSeparation, WhiteAndBlackAreTheLightestAndTheDarkestInkAlone) {
  const InkSet set = setOf({white, black, cyan, magenta, yellow});
  const InkSeparation separation(set);
  EXPECT_NEAR(separated(separation, set, {1, 1, 1})[0], 1, 1e-6);
  EXPECT_NEAR(separated(separation, set, {0, 0, 0})[1], 1, 1e-6);
}

TEST(InkSeparation, LightTintsSurviveWhereWhiteIsThatOfTheInk) {
  InkSet set = setOf({white, black, cyan, magenta, yellow});
  set.media_relative = true;
  const InkSeparation separation(set);
  EXPECT_NEAR(separated(separation, set, {1, 1, 1})[0], 1, 1e-6);
  EXPECT_NEAR(separated(separation, set, {0, 0, 0})[1], 1, 1e-6);
  const Vec3d tint(0.88, 0.85, 0.84);
  const Vec3d made = mixed(set, separated(separation, set, tint));
  EXPECT_LT((made - (black + tint * (white - black))).length(), 1e-5);
}

TEST(InkSeparation, GreysStayGrey) {
  for (const double share_of_black : {0.0, 0.5, 1.0}) {
    const InkSet set = setOf({white, black, cyan, magenta, yellow}, share_of_black);
    const InkSeparation separation(set);
    for (double grey = 0.05; grey < 0.85; grey += 0.01) {
      const Vec3d made = mixed(set, separated(separation, set, Vec3d(grey)));
      EXPECT_LT((made - Vec3d(grey)).length(), 1e-5) << grey;
    }
  }
}

TEST(InkSeparation, TakesAsMuchBlackAsItIsTold) {
  const std::vector<Vec3d> colours = {white, black, cyan, magenta, yellow};
  RandomMixtures mixtures(2);
  for (int i = 0; i < 100; ++i) {
    std::vector<std::vector<float>> found;
    Vec3d wanted;
    const std::vector<float> drawn = mixtures(colours.size());
    for (const double share_of_black : {0.0, 0.5, 1.0}) {
      const InkSet set = setOf(colours, share_of_black);
      wanted = mixed(set, drawn);
      found.push_back(separated(InkSeparation(set), set, wanted));
    }
    EXPECT_LE(found[0][1], found[1][1] + 1e-6F);
    EXPECT_LE(found[1][1], found[2][1] + 1e-6F);
    // Less black than the least, or more than the most, would make a coverage negative: in both an
    // ink is missing.
    EXPECT_LT(*std::min_element(found[0].begin(), found[0].end()), 1e-5F);
    EXPECT_LT(*std::min_element(found[2].begin(), found[2].end()), 1e-5F);
    EXPECT_GE(drawn[1], found[0][1] - 1e-5F);
    EXPECT_LE(drawn[1], found[2][1] + 1e-5F);
  }
}

TEST(InkSeparation, IsContinuous) {
  RandomMixtures mixtures(3);
  for (const std::vector<Vec3d>& colours : {std::vector{white, black},
                                            {white, black, yellow},
                                            {white, black, cyan, magenta},
                                            {white, black, cyan, magenta, yellow},
                                            {white, black, cyan, magenta, yellow, orange, green}}) {
    const InkSet set = setOf(colours);
    const InkSeparation separation(set);
    for (int line = 0; line < 30; ++line) {
      const Vec3d from = mixtures.colour();
      const Vec3d to = mixtures.colour();
      constexpr int steps = 4000;
      std::vector<float> before = separated(separation, set, from);
      for (int step = 1; step <= steps; ++step) {
        const std::vector<float> here =
            separated(separation, set, from + (to - from) * (static_cast<double>(step) / steps));
        for (std::size_t ink = 0; ink < here.size(); ++ink)
          ASSERT_NEAR(here[ink], before[ink], 0.03) << colours.size() << " inks, line " << line;
        before = here;
      }
    }
  }
}

TEST(InkSeparation, ColoursThatInksCannotMixKeepTheirLightness) {
  const InkSet set = setOf({white, black, cyan, magenta, yellow});
  const InkSeparation separation(set);
  const auto lightness = [](const Vec3d& colour) {
    return 116 * std::cbrt(0.2126 * colour[0] + 0.7152 * colour[1] + 0.0722 * colour[2]) - 16;
  };
  RandomMixtures mixtures(4);
  double sum = 0;
  int count = 0;
  for (int i = 0; i < 2000; ++i) {
    const Vec3d wanted = mixtures.colour();
    const double wanted_lightness = lightness(wanted);
    if (wanted_lightness < 30 || wanted_lightness > 85) continue;
    sum += std::abs(lightness(mixed(set, separated(separation, set, wanted))) - wanted_lightness);
    ++count;
  }
  EXPECT_GT(count, 1000);
  EXPECT_LT(sum / count, 5);
}

TEST(InkSeparation, TwoInksKeepTheLightnessOfColours) {
  const InkSet set = setOf({white, black});
  const InkSeparation separation(set);
  const std::vector<float> grey = separated(separation, set, Vec3d(0.7152));
  const std::vector<float> coloured = separated(separation, set, {0, 1, 0});
  EXPECT_NEAR(grey[1], coloured[1], 1e-4);
  EXPECT_GT(grey[0], 0.5);
}

TEST(InkSeparation, OneInkCoversEverything) {
  const InkSet set = setOf({cyan});
  EXPECT_EQ(separated(InkSeparation(set), set, {0.3, 0.9, 0.1}), std::vector<float>{1});
}

TEST(InkSeparation, LeavesTheClearInkOut) {
  InkSet set = setOf({white, Vec3d(0.8, 0.8, 0.95), black, cyan, magenta, yellow});
  set.clear = 1;
  RandomMixtures mixtures(5);
  const InkSeparation separation(set);
  for (int i = 0; i < 100; ++i) {
    const std::vector<float> coverages = separated(separation, set, mixtures.colour());
    expectCoverages(coverages);
    EXPECT_EQ(coverages[1], 0);
  }
}

TEST(InkSeparation, RefusesASetOfTheClearInkAlone) {
  InkSet set = setOf({white});
  set.clear = 0;
  EXPECT_THAT([&] { InkSeparation separation(set); },
              testing::ThrowsMessage<UsageError>("there must be an ink that is not clear"));
}

TEST(RootOf, IsThePowerOfTheLibrary) {
  for (const double x : {0.0, 1e-6, 0.02, 0.5, 0.999, 1.0})
    for (const double exponent : {1.0, 0.9, 0.5, 1.0 / 3, 0.0625})
      EXPECT_NEAR(rootOf(x, exponent), std::pow(x, exponent), 1e-13);
}

TEST(TableSeparation, InterpolatesItsNodesInTetrahedra) {
  InkSet set = setOf({white, black, cyan, magenta, yellow});
  const InkSeparation exact(set);
  CoverageTable table{17, {}};
  for (int red = 0; red < 17; ++red)
    for (int green_light = 0; green_light < 17; ++green_light)
      for (int blue = 0; blue < 17; ++blue) {
        const Vec3d node(red * red, green_light * green_light, blue * blue);
        const std::vector<float> coverages = separated(exact, set, node / 256);
        table.values.insert(table.values.end(), coverages.begin(), coverages.end());
      }
  set.table = table;
  const auto separation = separationInto(set);
  RandomMixtures mixtures(6);
  for (int i = 0; i < 300; ++i) {
    const Vec3d node(i % 17, i / 17 % 17, i * 7 % 17);
    EXPECT_EQ(separated(*separation, set, node * node / 256),
              separated(exact, set, node * node / 256));
    const Vec3d colour = mixed(set, mixtures(5));
    const std::vector<float> coverages = separated(*separation, set, colour);
    expectCoverages(coverages);
    EXPECT_LT((mixed(set, coverages) - colour).length(), 0.05);
  }
}

}  // namespace
}  // namespace vdbdither
