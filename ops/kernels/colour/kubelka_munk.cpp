#include "ops/kernels/colour/kubelka_munk.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>

#include <tbb/parallel_for.h>

#include "ops/kernels/colour/separation.h"
#include "ops/kernels/colour/small_matrix.h"

namespace vdbdither {

using openvdb::Vec3d;

namespace {

constexpr int table_edge = 33;
/// Coverages that rounding makes negative.
constexpr double tolerance = 1e-9;

Vec3d rootsOf(const Vec3d& linear_rgb) {
  return {std::sqrt(linear_rgb[0]), std::sqrt(linear_rgb[1]), std::sqrt(linear_rgb[2])};
}

/// The inverse of the law, one colour after another.
class Inverse {
 public:
  explicit Inverse(const InkSet& set)
      : law_(set), black_(set.black), media_relative_(set.media_relative), inks_(law_.inks()) {
    std::vector<Vec3d> colours;
    std::vector<double> luminance;
    for (std::size_t ink = 0; ink < inks_; ++ink) {
      std::vector<double> alone(inks_);
      alone[ink] = 1;
      colours.push_back(law_.colourOf(alone));
      luminance.push_back(luminanceOf(colours.back()));
    }
    const auto [dark, light] = std::minmax_element(luminance.begin(), luminance.end());
    dark_ = static_cast<std::size_t>(dark - luminance.begin());
    light_ = static_cast<std::size_t>(light - luminance.begin());
    dark_colour_ = colours[dark_];
    light_colour_ = colours[light_];
    forEachChoice(inks_, 4,
                  [&](const std::vector<std::size_t>& choice) { choices_.push_back(choice); });
  }

  /// Returns the coverages for linear light.
  [[nodiscard]] std::vector<double> coveragesOf(const Vec3d& linear_rgb) const {
    const Vec3d roots = rootsOf(
        media_relative_ ? betweenInks(linear_rgb, dark_colour_, light_colour_) : linear_rgb);
    if (const auto exact = mixtureOf(roots)) return *exact;
    const std::vector<double> aim = aimOf(roots);
    const Vec3d from = rootsOf(law_.colourOf(aim));
    std::vector<double> best = aim;
    double kept = 0;
    double lost = 1;
    constexpr int halvings = 14;
    for (int step = 0; step < halvings; ++step) {
      const double middle = (kept + lost) / 2;
      if (const auto mixture = mixtureOf(from + middle * (roots - from))) {
        best = *mixture;
        kept = middle;
      } else {
        lost = middle;
      }
    }
    return best;
  }

  [[nodiscard]] const KubelkaMunk& law() const { return law_; }

 private:
  /// Returns coverages whose mixture has this colour, if there are any. All of them are means of
  /// those with four inks.
  [[nodiscard]] std::optional<std::vector<double>> mixtureOf(const Vec3d& roots) const {
    const Vec3d ratios = law_.ratiosOf(roots * roots);
    std::vector<Vec3d> balances;
    for (std::size_t ink = 0; ink < inks_; ++ink) balances.push_back(law_.balanceOf(ink, ratios));
    std::optional<std::vector<double>> least;
    std::optional<std::vector<double>> most;
    double least_cost = 0;
    double most_cost = 0;
    for (const std::vector<std::size_t>& choice : choices_) {
      const auto found = mixtureOfFour(choice, balances);
      if (!found) continue;
      // Of equal black, always the same.
      double order = 0;
      for (std::size_t ink = 0; ink < inks_; ++ink)
        order += 1e-4 * static_cast<double>(ink * ink) * (*found)[ink];
      const double black = (*found)[dark_];
      if (!least || black + order < least_cost) {
        least = found;
        least_cost = black + order;
      }
      if (!most || order - black < most_cost) {
        most = found;
        most_cost = order - black;
      }
    }
    if (!least) return std::nullopt;
    for (std::size_t ink = 0; ink < inks_; ++ink)
      (*least)[ink] += black_ * ((*most)[ink] - (*least)[ink]);
    return least;
  }

  [[nodiscard]] std::optional<std::vector<double>> mixtureOfFour(
      const std::vector<std::size_t>& choice, const std::vector<Vec3d>& balances) const {
    Matrix rows{};
    for (std::size_t n = 0; n < 4; ++n) {
      rows[0][n] = 1;
      for (std::size_t channel = 0; channel < 3; ++channel)
        rows[channel + 1][n] = balances[choice[n]][static_cast<int>(channel)];
    }
    const auto inverse = inverseOf(rows, 4);
    if (!inverse) return std::nullopt;
    std::vector<double> coverages(inks_);
    double sum = 0;
    for (std::size_t n = 0; n < 4; ++n) {
      const double share = (*inverse)[n][0];
      if (!(share >= -tolerance)) return std::nullopt;
      sum += coverages[choice[n]] = std::max(share, 0.0);
    }
    for (double& coverage : coverages) coverage /= sum;
    return coverages;
  }

  /// The mixture that a colour moves to: a grey of its lightness, from the darkest and the lightest
  /// ink, and a share of all inks.
  [[nodiscard]] std::vector<double> aimOf(const Vec3d& roots) const {
    const double wanted = luminanceOf(roots * roots);
    double low = 0;
    double high = 1;
    std::vector<double> aim(inks_);
    constexpr int halvings = 30;
    for (int step = 0; step < halvings; ++step) {
      const double middle = (low + high) / 2;
      std::fill(aim.begin(), aim.end(), 0);
      aim[light_] = middle;
      aim[dark_] += 1 - middle;
      (luminanceOf(law_.colourOf(aim)) < wanted ? low : high) = middle;
    }
    const double saturation =
        std::max({roots[0], roots[1], roots[2]}) - std::min({roots[0], roots[1], roots[2]});
    for (double& coverage : aim)
      coverage += aim_pull * saturation * (1 / static_cast<double>(inks_) - coverage);
    return aim;
  }

  KubelkaMunk law_;
  double black_;
  bool media_relative_;
  std::size_t inks_;
  std::size_t dark_ = 0;
  std::size_t light_ = 0;
  Vec3d dark_colour_{0.0};
  Vec3d light_colour_{1.0};
  std::vector<std::vector<std::size_t>> choices_;
};

}  // namespace

KubelkaMunk::KubelkaMunk(const InkSet& set) : mirror_(*set.kubelka_munk) {
  for (std::size_t ink = 0; ink < set.inks.size(); ++ink) {
    if (ink == set.clear) continue;
    index_.push_back(ink);
    absorption_.push_back(*set.inks[ink].absorption);
    scattering_.push_back(*set.inks[ink].scattering);
  }
}

Vec3d KubelkaMunk::colourOf(const std::vector<double>& coverages) const {
  Vec3d absorption(0.0);
  Vec3d scattering(0.0);
  for (std::size_t ink = 0; ink < inks(); ++ink) {
    absorption += coverages[ink] * absorption_[ink];
    scattering += coverages[ink] * scattering_[ink];
  }
  Vec3d colour(0.0);
  for (int channel = 0; channel < 3; ++channel) {
    if (scattering[channel] == 0) continue;
    const double ratio = absorption[channel] / scattering[channel];
    const double inner = mirror_.inner[channel];
    // 1 + q − √(q² + 2q), without the difference of nearly equal numbers.
    const double opaque = 1 / (1 + ratio + std::sqrt(ratio * ratio + 2 * ratio));
    colour[channel] = (1 - mirror_.outer) * (1 - inner) * opaque / (1 - inner * opaque);
  }
  return colour;
}

Vec3d KubelkaMunk::ratiosOf(const Vec3d& linear_rgb) const {
  constexpr double least = 1e-6;
  Vec3d ratios;
  for (int channel = 0; channel < 3; ++channel) {
    const double inner = mirror_.inner[channel];
    const double light = linear_rgb[channel];
    const double opaque =
        std::clamp(light / ((1 - mirror_.outer) * (1 - inner) + inner * light), least, 1.0);
    ratios[channel] = (1 - opaque) * (1 - opaque) / (2 * opaque);
  }
  return ratios;
}

Vec3d KubelkaMunk::balanceOf(std::size_t ink, const Vec3d& ratios) const {
  // Scaled, so that inks and colours of all strengths are alike to the solver.
  Vec3d balance = absorption_[ink] - ratios * scattering_[ink];
  for (int channel = 0; channel < 3; ++channel) balance[channel] /= 1 + ratios[channel];
  return balance;
}

CoverageTable kubelkaMunkTable(const InkSet& set) {
  const Inverse inverse(set);
  const std::size_t inks = set.inks.size();
  CoverageTable table{table_edge, {}};
  constexpr auto edge = static_cast<std::size_t>(table_edge);
  table.values.resize(edge * edge * edge * inks);
  tbb::parallel_for(std::size_t{0}, edge * edge, [&](std::size_t row) {
    const auto light = [](std::size_t node) {
      const double root = static_cast<double>(node) / (table_edge - 1);
      return root * root;
    };
    for (std::size_t blue = 0; blue < edge; ++blue) {
      const std::vector<double> coverages =
          inverse.coveragesOf({light(row / edge), light(row % edge), light(blue)});
      float* node = &table.values[(row * edge + blue) * inks];
      for (std::size_t ink = 0; ink < coverages.size(); ++ink)
        node[inverse.law().indexOf(ink)] = static_cast<float>(coverages[ink]);
    }
  });
  return table;
}

}  // namespace vdbdither
