#pragma once

#include <array>

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

  /// Returns t, 0 … 1.
  ///
  /// \param d_mm  the distance of the voxel's centre, |d| ≤ k_D
  /// \param half_diameter_mm  k_D
  /// \param spread_mm  σ
  [[nodiscard]] float operator()(float d_mm, double half_diameter_mm, double spread_mm) const;

 private:
  [[nodiscard]] double share(double x) const;

  static constexpr int maximum = 6;
  static constexpr int cells_per_unit = 128;
  std::array<double, 2 * maximum * cells_per_unit + 2> shares_{};
};

}  // namespace vdbdither
