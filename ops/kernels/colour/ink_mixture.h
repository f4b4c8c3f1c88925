#pragma once

#include <array>
#include <span>
#include <vector>

#include <openvdb/Types.h>

namespace vdbdither {

/// Returns x to the power of `exponent`, both 0 … 1. It is computed with products and square roots
/// alone and so has the same bits on every machine with IEEE doubles.
double rootOf(double x, double exponent);

/// The colour of inks that lie side by side, finer than the eye resolves: in every channel of
/// linear light, R^(1/n) is the mean of the R_i^(1/n) of the inks by their coverages. n = 1 is
/// additive mixing; light that leaves through another ink than it came in through makes n larger.
///
/// Source: Yule, Nielsen: The penetration of light into paper and its effect on halftone
/// reproduction, TAGA Proceedings 3 (1951).
class InkMixture {
 public:
  /// @param linear_rgb    of each ink, 0 … 1
  /// @param yule_nielsen  n of red, green and blue, ≥ 1
  InkMixture(std::vector<openvdb::Vec3d> linear_rgb, const openvdb::Vec3d& yule_nielsen);

  /// Returns the linear light, clipped to 0 … 1, to the power 1/n: in this space colours mix
  /// linearly. From a table where n is not 2; the error is below 5e-6 above a linear light of 1e-4.
  [[nodiscard]] openvdb::Vec3d rootsOf(const openvdb::Vec3s& linear_rgb) const;

  /// Returns the same of each ink, without a table.
  [[nodiscard]] const std::vector<openvdb::Vec3d>& roots() const { return roots_; }

 private:
  std::vector<openvdb::Vec3d> roots_;
  /// Of each channel, the powers 2/n of the square roots of linear light in equal steps from 0 to
  /// 1; empty where n is 2, which leaves them as they are.
  std::array<std::vector<double>, 3> powers_;
};

}  // namespace vdbdither
