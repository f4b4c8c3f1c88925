#pragma once

#include <vector>

#include <openvdb/Types.h>

#include "vdbdither/model/ink_set.h"

namespace vdbdither {

/// The colour of translucent inks, finely mixed: absorption K and scattering S of the mixture are
/// the means of those of the inks by their coverages, in every channel of linear light. A thick
/// layer reflects R∞ = 1 + q − √(q² + 2q) with q = K/S; the mirror of its surface makes of it
/// (1 − outer)(1 − inner) R∞ / (1 − inner R∞).
///
/// Sources: Kubelka, Munk: Ein Beitrag zur Optik der Farbanstriche, Zeitschrift für technische
/// Physik 12 (1931); Saunderson: Calculation of the color of pigmented plastics, Journal of the
/// Optical Society of America 32(12), 1942.
class KubelkaMunk {
 public:
  /// @param set  has a mirror, and inks with absorption and scattering except the clear one
  explicit KubelkaMunk(const InkSet& set);

  /// The number of inks besides the clear one.
  [[nodiscard]] std::size_t inks() const { return index_.size(); }
  /// The place of one of them in the set.
  [[nodiscard]] std::size_t indexOf(std::size_t ink) const { return index_[ink]; }

  /// Returns the linear light, 0 … 1, of a mixture of these inks, of sum 1.
  [[nodiscard]] openvdb::Vec3d colourOf(const std::vector<double>& coverages) const;

  /// Returns K/S of a colour that a mixture has; values outside of what can be reflected are
  /// clipped.
  [[nodiscard]] openvdb::Vec3d ratiosOf(const openvdb::Vec3d& linear_rgb) const;

  /// Returns K − q S of an ink in each channel: the mean of these by coverages is 0 for a mixture
  /// of the ratios q.
  [[nodiscard]] openvdb::Vec3d balanceOf(std::size_t ink, const openvdb::Vec3d& ratios) const;

 private:
  SurfaceMirror mirror_;
  std::vector<std::size_t> index_;
  std::vector<openvdb::Vec3d> absorption_;
  std::vector<openvdb::Vec3d> scattering_;
};

/// Returns the coverages by this law over a grid of colours. Where more than four inks mix a colour
/// in several ways, `InkSet::black` lies between the least and the most of the darkest ink. A
/// colour that the inks cannot mix moves towards a grey of its own lightness as in InkSeparation,
/// here in the square roots of linear light.
///
/// At least four inks that are not clear. The time grows with the fourth power of their number.
CoverageTable kubelkaMunkTable(const InkSet& set);

}  // namespace vdbdither
