#pragma once

#include <array>
#include <cstddef>

#include "ops/kernels/leaf/floats.h"

namespace vdbdither {

/// The share of the voxels at one distance from a facet that are printed, so that the printed
/// surface lies on the facet.
///
/// Let a = k_D − d be the height of the facet above the bottom of the voxels at the distance d, and
/// σ the blur of the process along the normal. Printing the share t of these voxels puts the level
/// ½ of the blur onto the facet if t = (½ − Φ(−a/σ)) / (Φ((2k_D − a)/σ) − Φ(−a/σ)). If the step of
/// one voxel is small against σ, this is ½ − d/(2k_D), the coverage of the voxels. The curve lies
/// between both, as a process may be blunter than stated.
class ToneCurve {
 public:
  ToneCurve();

  /// Sets `tone` to t, 0 … 1, of four voxels.
  ///
  /// \param d_mm  the distances of the voxels' centres, |d| ≤ k_D
  /// \param half_diameter_mm  k_D
  /// \param spread_mm  σ
  [[gnu::always_inline]] void operator()(const Doubles& d_mm, const Doubles& half_diameter_mm,
                                         const Doubles& spread_mm, Doubles& tone) const {
    const Doubles bottom = (d_mm - half_diameter_mm) / spread_mm;
    Doubles below, above;
    findShares(bottom, below);
    findShares(bottom + 2.0 * half_diameter_mm / spread_mm, above);
    const Doubles step = above - below;
    const Doubles coverage = 0.5 - d_mm / (2.0 * half_diameter_mm);
    const Doubles level = step > 0.0 ? (0.5 - below) / step : coverage;
    tone = coverage + level_share * (level - coverage);
    clamp(tone, 0, 1);
  }

  /// Returns t of one voxel.
  [[nodiscard]] float operator()(float d_mm, double half_diameter_mm, double spread_mm) const {
    Doubles tone;
    (*this)(Doubles{} + double{d_mm}, Doubles{} + half_diameter_mm, Doubles{} + spread_mm, tone);
    return static_cast<float>(tone[0]);
  }

 private:
  /// Φ at the lower end of a cell, and its rise to the upper.
  struct Cell {
    double share, rise;
  };

  /// A larger share leaves weaker stripes where steps are high, and more error after a blur of 2σ.
  static constexpr double level_share = 0.68;
  static constexpr int maximum = 6;
  static constexpr int cells_per_unit = 128;

  [[gnu::always_inline]] static void clamp(Doubles& values, double low, double high) {
    values = values < low ? Doubles{} + low : values;
    values = values > high ? Doubles{} + high : values;
  }

  [[gnu::always_inline]] void findShares(const Doubles& x, Doubles& shares) const {
    Doubles at = x;
    clamp(at, -maximum, maximum);
    at = (at + double{maximum}) * double{cells_per_unit};
    Doubles share, rise, whole;
    for (std::size_t lane = 0; lane < 4; ++lane) {
      const auto number = static_cast<int>(at[lane]);
      const Cell& cell = cells_[static_cast<std::size_t>(number)];
      share[lane] = cell.share;
      rise[lane] = cell.rise;
      whole[lane] = number;
    }
    shares = share + (at - whole) * rise;
  }

  std::array<Cell, 2 * maximum * cells_per_unit + 1> cells_{};
};

}  // namespace vdbdither
